"""The marks on the pages of a questionnaire while a person answers it."""

from collections.abc import Callable, Iterator, Mapping

from ..questionnaire import Item, Questionnaire

ROWS = 6
"""Items on one page."""


class AnswerSheet:
    """The marks of a questionnaire, its pages of at most `ROWS` items, and the selected item.

    It begins at the first item without a mark.

    Attributes:
        form: the questionnaire.
        page: number of the page, from 0.
        row: number of the selected item on the page; that of the button below the items is the number of items.
        done: every item has a mark, and the button of the last page was chosen.
    """

    def __init__(self, form: Questionnaire, saved: Mapping[str, float], clock: Callable[[], int]):
        """
        Args:
            saved: answers by item; at least one item is without.
            clock: monotonic time, ns.
        """
        self.form = form
        self.done = False
        self._clock = clock
        scale = form.scale
        self._marks = {item.name: scale.mark(saved[item.name]) if item.name in saved else None for item in form.items}
        self._saved = dict(self._marks)
        self._seconds: dict[str, float] = {}  # from the selection of an item to the last move of its mark
        items = list(form.items)
        self._pages = [items[k : k + ROWS] for k in range(0, len(items), ROWS)]
        self.page = next((k for k, page in enumerate(self._pages) if self._open(page)), 0)
        self.row = next((row for row, item in enumerate(self.items) if self.mark(item) is None), 0)
        self._selected_ns = clock()

    @property
    def items(self) -> list[Item]:
        """The items of the page."""
        return self._pages[self.page]

    @property
    def item(self) -> Item | None:
        """The selected item; None if the button below the items is selected."""
        return self.items[self.row] if self.row < len(self.items) else None

    @property
    def on_last_page(self) -> bool:
        """No page follows."""
        return self.page + 1 == len(self._pages)

    @property
    def position(self) -> str:
        """The page and the number of answers."""
        answered = sum(mark is not None for mark in self._marks.values())
        return f"page {self.page + 1} of {len(self._pages)}, {answered} of {len(self._marks)} answered"

    def mark(self, item: Item) -> int | None:
        """The mark of an item, counted from 0; None without an answer."""
        return self._marks[item.name]

    def place(self, mark: int) -> bool:
        """Places the mark of the selected item; returns whether it was moved."""
        item = self.item
        if item is None or self.mark(item) == mark:
            return False
        self._marks[item.name] = mark
        self._seconds[item.name] = (self._clock() - self._selected_ns) / 1e9
        return True

    def move(self, direction: int) -> bool:
        """Moves the mark of the selected item by -1 or 1; the first one is placed in the middle of the scale."""
        if self.item is None:
            return False
        mark, marks = self.mark(self.item), self.form.scale.marks
        return self.place((marks - 1) // 2 if mark is None else min(marks - 1, max(0, mark + direction)))

    def select(self, row: int) -> None:
        """Selects an item of the page or the button; the row -1 is the last item of the page before."""
        if row < 0 and self.page > 0:
            self.page -= 1
            row = len(self.items) - 1
        self.row = max(0, min(row, len(self.items)))
        self._selected_ns = self._clock()

    def accept(self) -> str:
        """Goes on to the next item, the next page or the end; returns what is missing for that, else an empty text."""
        item, left = self.item, self._open(self.items)
        if item is not None and self.mark(item) is None:
            return "move the mark to the left or right"
        if item is not None:
            self.select(self.row + 1)
        elif left:
            self.select(self.items.index(left[0]))
            return "one answer is missing" if len(left) == 1 else f"{len(left)} answers are missing"
        elif not self.on_last_page:
            self.page += 1
            self.select(0)
        else:
            self.done = True
        return ""

    def changed(self) -> Iterator[tuple[str, float, float]]:
        """The answers that differ from the saved ones: item, value, and seconds that the person took.

        An answer counts as saved when the next one is asked for.
        """
        for name, mark in self._marks.items():
            if mark is not None and mark != self._saved[name]:
                yield name, self.form.scale.value(mark), round(self._seconds[name], 3)
                self._saved[name] = mark

    def _open(self, items: list[Item]) -> list[Item]:
        return [item for item in items if self.mark(item) is None]
