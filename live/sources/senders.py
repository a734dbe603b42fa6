"""The choice among several senders to one address.

Two vehicles in one stream would give one calm and wrong estimate. Each quantity is taken from its
first sender. All messages of a second sender of the same quantity are left out until the first is
silent for 2 s. Senders of different quantities (a camera's poses, an autopilot's rotor speeds)
join. A program with a socket for each message never sends twice from one address: nobody is first
by a single message.
"""

from collections import deque
from collections.abc import Collection

from ..messages import SECOND
from ..tallies import Tallies

_SILENT = 2.0  # s without a message until another sender is taken
_REMEMBERED = 64  # senders
_TOLD = 4  # lines, however many senders there are


class Senders:
    """The senders to an address, and their quantities.

    Args:
        name: the address, for people.
        tallies: counts other senders' messages.
    """

    def __init__(self, name: str, tallies: Tallies) -> None:
        self._name = name
        self._tallies = tallies
        self._last: dict[str, int] = {}  # ns, the senders taken, in order of arrival
        self._single: dict[str, bool] = {}  # the same: only one message so far
        self._sender_of: dict[str, str] = {}  # by quantity
        self._rivals: dict[str, str] = {}  # senders left out, and their first sender
        self._once: deque[str] = deque(maxlen=_REMEMBERED)  # senders with one message
        self._lines = 0
        self._changed = False

    def take(self, sender: str, quantities: Collection[str], arrival: int) -> bool:
        """Return whether a sender's message with its ``arrival``, ns, is taken."""
        other = self._rivals.get(sender)
        for name in quantities:
            if other is None and self._sender_of.get(name, sender) != sender:
                other = self._sender_of[name]
        if other is None:
            self._last[sender] = arrival
            self._single[sender] = sender not in self._single and sender not in self._once
            self._sender_of |= dict.fromkeys(quantities, sender)
            return True
        if arrival - self._last[other] > _SILENT * SECOND:
            self._forget(other)
            self._changed = True
            self._say(f"{other} is silent; {sender} is listened to")
        elif self._single[other]:
            self._once.append(other)
            self._forget(other)
        elif self._is_before(sender, other):
            self._leave_out(other, sender)
        else:
            self._leave_out(sender, other)
            self._tallies.counts["other senders"] += 1
            return False
        return self.take(sender, quantities, arrival)

    def leaves_out(self, sender: str) -> bool:
        """Return whether the messages of a sender are left out."""
        return sender in self._rivals

    def changed(self) -> bool:
        """Return whether a sender has replaced a silent one since the last call."""
        changed = self._changed
        self._changed = False
        return changed

    def _is_before(self, sender: str, other: str) -> bool:
        taken = list(self._last)
        return sender in taken and taken.index(sender) < taken.index(other)

    def _leave_out(self, rival: str, first: str) -> None:
        if rival in self._rivals:
            return
        if rival in self._last:
            self._forget(rival)
        if len(self._rivals) < _REMEMBERED:
            self._rivals[rival] = first
        self._say(
            f"{first} and {rival} send the same; {first} is listened to until it is silent for "
            f"{_SILENT:g} s"
        )

    def _forget(self, sender: str) -> None:
        del self._last[sender], self._single[sender]
        self._sender_of = {what: who for what, who in self._sender_of.items() if who != sender}
        self._rivals = {rival: first for rival, first in self._rivals.items() if first != sender}

    def _say(self, line: str) -> None:
        if self._lines < _TOLD:
            self._lines += 1
            self._tallies.say(f"warning: {self._name}: {line}")
