"""Short runs of the fuzz programs of FANUC, and proof that they find faults."""

import re

import pytest

from controllers.fanuc import data
from controllers.fanuc.assignments import Block
from controllers.fanuc.data import Position
from controllers.fanuc.ftp import files
from controllers.fanuc.ftp import protocol as ftp
from controllers.fanuc.ftp.driver import FtpDriver
from controllers.fanuc.rmi import messages as rmi
from controllers.fanuc.rmi.messages import Answer
from tests.controllers.fanuc import fuzz_ftp, fuzz_rmi, fuzz_snpx
from tests.fuzz.fuzzing import assert_found, assert_strict, broken

STATE = {"JointsReceived": 300, "MalformedReceived": 300, "SignalsReceived": 300}
RARE = {"AlarmReceived": 50, "StatusReceived": 50}
# A number that has lost its point.
CARELESS = re.compile(r"(Joint|EXTAXS:) +(\d{1,2}): *-?(\d*\.?\d*|\*+) *")


def careless_answer(line, read=rmi.read):
    answer = read(line)
    return Answer(answer.name, 0, answer.sequence, answer.port or 1, answer.version)


def careless_position(words):
    return Position(None, data.POSITION.unpack(words)[17:26])


def words_of_another_client(block, words):
    begin = block.first_word
    return {
        each.variable: words[2 * (each.first_word - begin) :][: 2 * each.variable.words]
        for each in block.assignments
    }


def begin_as_confirmed(driver, now_s, begin=FtpDriver._begin_file):
    begin(driver, now_s)
    driver._whole = True


@pytest.mark.parametrize(
    ("program", "least"),
    [
        (fuzz_ftp, STATE | RARE),
        (fuzz_rmi, dict.fromkeys(("MalformedReceived", "motion", "abort", "aborts"), 500)),
        (fuzz_snpx, STATE | RARE),
    ],
)
@pytest.mark.slow
def test_changed_messages_give_nothing_but_what_a_strict_reading_gives(program, least):
    assert_strict(program, least)


@pytest.mark.parametrize(
    ("program", "owner", "attribute", "fault", "problem"),
    [
        (fuzz_ftp, files, "_JOINT", CARELESS, "strict reading gives|could not convert"),
        (fuzz_ftp, FtpDriver, "_begin_file", begin_as_confirmed, "before the answer to b'RETR|a pose with"),
        (fuzz_ftp, ftp, "PASSIVE", b"DELE MAIN.TP\r\n", "sends b'DELE"),
        (fuzz_rmi, rmi, "read", careless_answer, "a strict reading gives"),
        (fuzz_rmi, rmi, "_integer", broken, "ZeroDivisionError"),
        (fuzz_snpx, data, "position", careless_position, "a strict reading gives"),
        (fuzz_snpx, Block, "values", words_of_another_client, ""),
        (fuzz_snpx, data, "text", broken, "ZeroDivisionError"),
    ],
)
def test_a_fault_of_a_driver_is_found(program, owner, attribute, fault, problem, monkeypatch):
    monkeypatch.setattr(owner, attribute, fault)
    assert_found(program, problem)
