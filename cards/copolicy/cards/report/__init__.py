"""The report of a data set: one self-contained HTML page."""

from .command import add_report_command

__all__ = ["add_report_command"]
