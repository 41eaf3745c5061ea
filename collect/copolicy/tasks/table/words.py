"""Words for the table on screens, cards, pages and figures."""

from copolicy.dataset.task_words import TaskWords

WORDS = TaskWords(
    about="Two players carry a table past obstacles to a goal",
    episodes_of="two players carrying a table",
    tag="table-carrying",
    numbers=(
        "Positions are px in a window of 1200 x 600, y down; angles rad, counter-clockwise on screen; forces in "
        "units of a player's full force."
    ),
    cast="Two players, one table",
    act="carry",
    act_s="carries",
    place="a simulated plane",
    episode="one carry from start to end",
    record="One record an episode: who carried what with whom on which map, and how it ended.",
    invitation="carry the table together",
    instruction="Carry the table to the green goal together. You do not know which route your partner will take.",
    purpose="carry an object *with* a partner, where there are several good routes and both have to agree on one",
    limits="The table moves in a plane under known dynamics",
    scenario="map",
    scenarios="maps",
    scenario_sees="the map (start, goal, up to three obstacles)",
    noun="table",
    body="the table's centre",
    state_sees="the table's pose and velocity",
    acts="carries a table together with a partner, in a simulated plane seen from above",
    action="forces in [-1, 1]",
    success="reached the goal",
    failure="ended short of the goal",
    did_not="did not reach the goal",
    scene="The table, both players' forces and the map",
    stand_in="Two scripted agents, one at each end of the table, stand in for people.",
    label="route",
    label_class="route class",
    labels=(
        "one letter an obstacle (L: the table passed below it on screen, R: above it)",
        "one letter an obstacle, L where the table passed below it on screen when carried to the right, R above it",
    ),
    # On the maps of all sets the table is carried to the right.
    meanings={"L": "below", "LL": "below all", "LLL": "below all", "R": "above", "RR": "above all", "RRR": "above all"},
    interaction="interaction force",
    interaction_unit="units of a player's full force",
    interaction_senses=("pulling apart", "pressing together", "in agreement"),
    interaction_above="pulls apart",
    interaction_note=(
        "The interaction force is half the difference of the two forces along the table: how hard the players pull "
        "apart (positive) or press together (negative) without moving it."
    ),
    citation="The task, its dynamics and its maps are those of the paper:",
    paper="""@article{ng2023diffusion,
  title   = {Diffusion Co-Policy for Synergistic Human-Robot Collaborative Tasks},
  author  = {Ng, Eley and Liu, Ziang and Kennedy, Monroe},
  journal = {IEEE Robotics and Automation Letters},
  year    = {2023},
  eprint  = {2305.12171},
  archivePrefix = {arXiv}
}""",
)
