"""The rules of `copolicy-dataset check`: one family per module, all limits in `limits`.

`checking.check_dataset` applies them. This file imports nothing, so that other commands start quickly.
"""
