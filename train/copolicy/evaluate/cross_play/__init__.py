"""Cross-play: every robot with every partner on the same starts, each planning for itself."""

from .command import add_cross_play_command

__all__ = ["add_cross_play_command"]
