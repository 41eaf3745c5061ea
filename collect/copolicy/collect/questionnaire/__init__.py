"""Questionnaires: their items as data, and the file of a person's answers."""

from .answers import Answer, AnswerFile, answers_in
from .form import FORMS, Item, Questionnaire, Scale, Score, read_questionnaire

__all__ = [
    "FORMS", "Answer", "AnswerFile", "Item", "Questionnaire", "Scale", "Score", "answers_in", "read_questionnaire",
]  # fmt: skip
