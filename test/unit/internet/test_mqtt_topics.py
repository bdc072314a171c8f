import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.internet.mqtt_topics import Broker, Destination, Topics, parse_broker


@pytest.mark.parametrize(
    ("url", "broker"),
    [
        ("mqtt://broker/", Broker("broker", 1883, False, "mesh")),
        ("mqtt://broker:1884/field", Broker("broker", 1884, False, "field")),
        ("mqtts://me@10.0.0.1/", Broker("10.0.0.1", 8883, True, "mesh", "me", "secret")),
        ("mqtt://a%3Ab%25@broker/", Broker("broker", 1883, False, "mesh", "a:b%", "secret")),
        ("mqtt://a@b@broker/", Broker("broker", 1883, False, "mesh", "a@b", "secret")),
    ],
)
def test_an_address_names_the_broker(url, broker):
    assert parse_broker(url, "secret" if broker.user else "") == broker


@pytest.mark.parametrize(
    ("url", "password", "why"),
    [
        ("http://broker/", "", "use mqtt://HOST/"),
        ("mqtt://broker:70000/", "", "invalid MQTT address"),
        ("mqtt://me:secret@broker/", "", "shows in the list of processes"),
        ("mqtt://broker/a/b", "", "invalid mesh name 'a/b'"),
        ("mqtt://broker/+", "", "invalid mesh name"),
        ("mqtt://broker/", "secret", "needs a user"),
    ],
)
def test_a_bad_address_is_refused_with_the_reason(url, password, why):
    with pytest.raises(ConfigurationError, match=why):
        parse_broker(url, password)


def test_an_address_of_ipv6_is_written_as_it_is_given():
    assert parse_broker("mqtt://[::1]:1884/field").url == "mqtt://[::1]:1884"


def test_the_topics_of_a_node():
    topics = Topics("field")
    assert topics.rx(5, 0) == "drone_mesh/field/5/rx"
    assert topics.rx(5, 7) == "drone_mesh/field/5/rx/7"
    assert topics.state(5) == "drone_mesh/field/5/state"


@pytest.mark.parametrize(
    ("level", "destination"),
    [
        ("5/tx", Destination(5, 0)),
        ("253/tx/255", Destination(253, 255)),
        ("all/tx/1", Destination(254, 1)),
        ("254/tx", None),
        ("-1/tx", None),
        ("²/tx", None),
        ("5/tx/256", None),
        ("5/tx/x", None),
        ("gateway/tx", None),
    ],
)
def test_a_topic_says_where_a_message_goes(level, destination):
    assert Topics("field").destination(f"drone_mesh/field/{level}") == destination
