"""Replay of a recording: in a window, as a video, GIF or contact sheet, in Rerun, or as a check by simulation."""
