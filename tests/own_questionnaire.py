"""A questionnaire of a lab's own, as the content of its file."""

OWN = {
    "name": "own", "title": "Own", "instruction": "?", "source": "our lab",
    "scale": {"low": 0, "high": 10, "step": 2, "labels": ["no", "yes"]},
    "items": [{"name": "one", "text": "One?"}, {"name": "two", "text": "Two?", "labels": ["a", "b"]}],
}  # fmt: skip
