"""Worker process that reads recordings for `serving`: `python -m services.recorder.reading.reader`."""

from robomesh.files.worker import answer_all
from services.recorder.reading.answers import Answers

if __name__ == "__main__":
    answer_all(lambda folder: Answers(folder).answer)
