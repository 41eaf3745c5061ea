"""Names of partners on the command line."""

import pytest

from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.task import get_task
from copolicy.evaluate.partners.names import PartnerName, parse_partners

TABLE = get_task("table")


def test_every_kind_of_partner_has_its_name_and_options():
    texts = [
        "stubborn", "scripted:slow,noise=0.3", "proxy:runs/p1,delay=0.2,noise=.3,commit=0.8", "mine=proxy:a=b/c,x",
        "human-like", "old=human-like,delay=0.34", "replay:recordings/people",
    ]  # fmt: skip
    assert parse_partners(texts, TABLE) == [
        PartnerName("stubborn", "scripted", "stubborn"),
        PartnerName("slow,noise=0.3", "scripted", "slow", {"noise": 0.3}),
        PartnerName(
            "proxy:p1,delay=0.2,noise=0.3,commit=0.8", "proxy", "runs/p1", {"delay": 0.2, "noise": 0.3, "commit": 0.8}
        ),
        PartnerName("mine", "proxy", "a=b/c,x"),
        PartnerName("human-like", "human-like"),
        PartnerName("old", "human-like", "", {"delay": 0.34}),
        PartnerName("replay:people", "replay", "recordings/people"),
    ]


def test_the_same_text_twice_is_one_partner():
    assert len(parse_partners(["slow", "slow"], TABLE)) == 1


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["kind"], "unknown kind of partner 'kind'; available: erratic, follower, slow, stubborn"),
        (["scripted:kind"], "unknown kind of partner 'kind'; available: erratic, follower, slow, stubborn"),
        (["policy:x"], "--partners: expected proxy:CHECKPOINT, scripted:KIND, human-like or replay:FOLDER, found"),
        (["proxy:"], "--partners: expected proxy:CHECKPOINT, scripted:KIND, human-like or replay:FOLDER, found"),
        (["slow,commit=1"], "--partners slow,commit=1: expected options of a scripted partner (delay, noise), found"),
        (["replay:x,delay=0.1"], "--partners replay:x,delay=0.1: expected options of a replay partner (noise), found"),
        (["proxy:x,delay=3"], "--partners delay: expected a number from 0 to 2, found '3'"),
        (["proxy:x,noise=much"], "--partners noise: expected a number from 0 to 5, found 'much'"),
        (
            ["proxy:x,skill=1"],
            "--partners proxy:x,skill=1: expected options of a proxy partner (delay, noise, commit), found",
        ),
        (["proxy:a/x", "proxy:b/x"], "--partners: expected partners of different names (NAME=... gives one), found"),
        ([], "--partners: expected at least one partner, found"),
    ],
)
def test_another_name_is_refused_in_one_line(texts, message):
    with pytest.raises(CopolicyError) as error:
        parse_partners(texts, TABLE)
    assert str(error.value).startswith(message)
