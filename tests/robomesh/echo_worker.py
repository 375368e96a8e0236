"""A worker for the tests: echoes, fails, crashes or sleeps."""

import os
import sys
import time

from robomesh.files import worker


class OfTwoArgumentsError(Exception):
    def __init__(self, what, why):
        super().__init__(f"{what}: {why}")


def begin(settings):
    if settings == "wrong":
        raise ValueError("settings are wrong")

    def answer(question):
        match question:
            case ("fail", text):
                raise ValueError(text)
            case ("fail twice", text):
                raise OfTwoArgumentsError(text, text)
            case "time out":
                raise TimeoutError("the disk")
            case ("allocate", size):
                bytearray(size)
            case ("report", values):
                for value in values:
                    worker.report(value)
            case ("send", data):
                worker._answers._stream.write(data)
                worker._answers._stream.flush()
                time.sleep(60.0)
            case "die":
                os._exit(3)
            case ("say and sleep", seconds):
                print("asleep", file=sys.stderr, flush=True)
                time.sleep(seconds)
            case ("sleep", seconds):
                time.sleep(seconds)
            case "print":
                print("not an answer")
        return settings, os.getpid(), question

    return answer


if __name__ == "__main__":
    worker.answer_all(begin)
