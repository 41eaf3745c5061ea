"""Who can hold an end of the table: a person, a simulated player, an earlier recording, a policy."""

from .controller import Controller, Reading
from .people import PersonController
from .policy import PolicyController
from .replay import ReplayController
from .scripted import ScriptedController

__all__ = ["Controller", "PersonController", "PolicyController", "Reading", "ReplayController", "ScriptedController"]
