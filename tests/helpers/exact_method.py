"""A method that asks the referee, through the contract of a method; and what is changed of its answers, to be found."""

from shadowbench.harness.frame.method import SimpleMethod
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.reference import exact_reference


class ExactMethod(SimpleMethod):
    """Answers exactly, and then changes what ``spoil`` changes."""

    name = title = "exact"
    capturable = False
    devices = ("cpu",)

    def build_structure(self, frame):
        moment = frame.host
        referee = Referee(moment.points, frame.prepared.faces, moment.valid)
        self.answers = self.exact(frame.prepared, moment, referee)
        self.spoil(self.answers)

    def exact(self, prepared, moment, referee):
        return exact_reference(prepared, moment, referee).answers()

    def spoil(self, answers):
        pass

    def trace_primary(self, frame):
        for part in ("triangle", "t", "u", "v"):
            getattr(frame.answers, part).assign(self.answers[part])

    def trace_shadow(self, frame, light):
        frame.answers.shadowed[light].assign(self.answers["shadowed"][light])
