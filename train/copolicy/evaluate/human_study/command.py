"""`copolicy-eval human plan | run | summarise`."""

from copolicy.dataset.command_line.commands import Commands, add_group

from .plan_command import add_plan
from .run_command import add_run
from .summarise_command import add_summarise


def add_human_command(commands: Commands) -> None:
    """Adds `human` with its three steps to the commands of `copolicy-eval`."""
    steps = add_group(
        commands,
        "human",
        "the human study: plan it, run a person's session, summarise the recordings",
        "A person at the human's seat with several robots in turn, blind and counterbalanced.",
        (
            "copolicy-eval human plan CoDP-H=outputs/codp_h CoDP=outputs/codp --out study/plan.json",
            "copolicy-eval human run study/plan.json --participant P01 --out study/recordings",
            "copolicy-eval human summarise study/recordings --plan study/plan.json --out study/result.json",
        ),
    )
    add_plan(steps)
    add_run(steps)
    add_summarise(steps)
