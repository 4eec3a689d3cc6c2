"""A method that asks the referee, through the contract of a method; and what is changed of its answers, to be found."""

from helpers.exact_answers import exact_answers
from shadowbench.harness.frame.method import SimpleMethod


class ExactMethod(SimpleMethod):
    """Answers exactly, and then changes what ``spoil`` changes."""

    name = title = "exact"
    capturable = False
    devices = ("cpu",)

    def build_structure(self, frame):
        self.answers = exact_answers(frame.prepared, frame.host)
        self.spoil(self.answers)

    def spoil(self, answers):
        pass

    def trace_primary(self, frame):
        for part in ("triangle", "t", "u", "v"):
            getattr(frame.answers, part).assign(self.answers[part])

    def trace_shadow(self, frame, light):
        frame.answers.shadowed[light].assign(self.answers["shadowed"][light])
