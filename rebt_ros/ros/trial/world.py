"""The world as a trial sees it: it is put at a start, and says how an episode went."""

from __future__ import annotations

from typing import Any, Final

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from rebt_ros.errors import OptionError
from rebt_ros.ros.trial.peer import PATIENCE, TrialPeer
from rebt_ros.trial.errors import TrialError
from rebt_ros.trial.outcome import success_of
from rebt_ros.trial.settings import StartParameter, TrialSettings

#: A simulator may have to load its world anew (seconds).
_RESETTING: Final = 120.0
_SETTING: Final = 30.0

_KINDS: Final = {"std_msgs/msg/Bool": Bool, "std_msgs/msg/String": String}


class World:
    """Puts the world at the starts of episodes, as far as it can be.

    Args:
        peer: Talks to it.
        settings: Of the trial.
    """

    def __init__(self, peer: TrialPeer, settings: TrialSettings) -> None:
        self._peer = peer
        self._start = settings.start
        self._told_by_reset = settings.told_by_reset
        self._clients: dict[type, Client] = {}
        # Before the parameter's: who answers a call knows of all that was opened before.
        if settings.reset_service is not None:
            self._clients[Trigger] = peer.create_client(Trigger, settings.reset_service)
        if self._start is not None:
            name = f"{self._start.node}/set_parameters"
            self._clients[SetParameters] = peer.create_client(SetParameters, name)
        self._fresh = False

    def connect(self) -> None:
        """Finds its services.

        Raises:
            TrialError: One is not there.
        """
        for client in self._clients.values():
            self._peer.find(client)

    def place(self, episode: int) -> int | None:
        """Puts the world at the start of an episode.

        Args:
            episode: Its number, from 0.

        Returns:
            The start, where the world can be told one.

        Raises:
            TrialError: A service refuses, or does not answer.
        """
        start = None
        if self._start is not None:
            start = self._start.first + episode
            self._set(self._start, start)
        if Trigger in self._clients and not (self._fresh and start is None):
            answer = self.reset()
            # Where it tells of an episode before, there may have been none.
            if not answer.success and not self._told_by_reset:
                name = self._peer.name_of(self._clients[Trigger])
                raise TrialError(f"service {name} refuses: {answer.message}")
        self._fresh = False
        return start

    def reset(self) -> Any:
        """Resets the world; returns the answer.

        Raises:
            TrialError: There is none.
        """
        self._fresh = True
        return self._peer.call(self._clients[Trigger], Trigger.Request(), _RESETTING, again=False)

    def _set(self, start: StartParameter, value: int) -> None:
        content = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
        request = SetParameters.Request(parameters=[Parameter(name=start.name, value=content)])
        client = self._clients[SetParameters]
        (result,) = self._peer.call(client, request, _SETTING, again=True).results
        if not result.successful:
            raise TrialError(
                f"{start.node} does not take {value} for its parameter {start.name}: "
                f"{result.reason or 'it does not say why'}."
            )


class TopicJudge:
    """Hears on a topic how episodes go.

    Args:
        peer: Listens.
        topic: Of Bool or String.
        field: As of `success_of`.
    """

    def __init__(self, peer: TrialPeer, topic: str, field: str | None) -> None:
        self._peer = peer
        self._topic = peer.resolve_topic_name(topic)
        self._field = field
        self._heard: list[Any] = []

    def connect(self) -> None:
        """Finds who publishes, and listens.

        Raises:
            OptionError: The topic is not one of Bool or String.
            TrialError: Nobody publishes on it.
        """
        if not self._peer.wait(lambda: self._peer.count_publishers(self._topic), PATIENCE):
            raise TrialError(
                f"nobody publishes on {self._topic}: start what tells how episodes end, or check "
                "the name."
            )
        publishers = self._peer.get_publishers_info_by_topic(self._topic)
        kinds = sorted({publisher.topic_type for publisher in publishers})
        kind = _KINDS.get(kinds[0]) if len(kinds) == 1 else None
        if kind is None:
            raise OptionError(
                f"{self._topic} carries {' and '.join(kinds) or 'nothing'}: outcomes come as "
                "std_msgs/msg/Bool or std_msgs/msg/String."
            )
        if kind is Bool and self._field is not None:
            raise OptionError(
                f"{self._topic} carries std_msgs/msg/Bool, which has no fields: leave "
                "--outcome-field out."
            )
        reliable = all(
            publisher.qos_profile.reliability is ReliabilityPolicy.RELIABLE
            for publisher in publishers
        )
        # What was published before is of no interest, even where the publisher remembers it.
        qos = QoSProfile(
            depth=100,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        )
        self._peer.create_subscription(kind, self._topic, self._heard.append, qos)

    def begin(self) -> None:
        """Forgets what it has heard before."""
        self._heard.clear()

    def ready(self) -> bool:
        """Always."""
        return True

    def success(self) -> bool | None:
        """The first word since the episode began.

        Raises:
            InputError: It says neither success nor failure.
        """
        if not self._heard:
            return None
        data = self._heard[0].data
        return data if isinstance(data, bool) else success_of(data, self._field)


class SilentJudge:
    """Leaves it to the service that resets the world."""

    def begin(self) -> None:
        """Does nothing."""

    def ready(self) -> bool:
        """Always."""
        return True

    def success(self) -> bool | None:
        """Not known before the reset."""
        return None
