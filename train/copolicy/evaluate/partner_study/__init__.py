"""The paper's human-in-the-loop protocol with simulated partners at the human's seat."""

from .command import add_partner_command

__all__ = ["add_partner_command"]
