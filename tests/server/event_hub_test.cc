#include "server/http/event_hub.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <thread>
#include <vector>

namespace joulecast::http {
namespace {

using namespace std::chrono_literals;

std::string drain(StreamSource& source) {
  std::string text;
  source.pull(text);
  return text;
}

std::string id_of(const std::string& event) {
  const auto begin = event.rfind("id: ") + 4;
  return event.substr(begin, event.find('\n', begin) - begin);
}

TEST(EventHub, DeliversInOrderToAll) {
  EventHub hub;
  const auto a = hub.subscribe().value();
  const auto b = hub.subscribe().value();
  hub.publish("x", "1");
  hub.publish("y", "2");
  const std::string text = drain(*a);
  EXPECT_EQ(text, drain(*b));
  EXPECT_LT(text.find("event: x\n"), text.find("event: y\n"));
  EXPECT_EQ(drain(*a), "");
  EXPECT_EQ(hub.counts().published, 2U);
}

TEST(EventHub, SelectsByTopic) {
  EventHub hub;
  const auto one = hub.subscribe("", "r1").value();
  hub.publish("state", "1", "r1");
  hub.publish("state", "2", "r2");
  hub.publish("fleet", "3");
  const std::string text = drain(*one);
  EXPECT_NE(text.find("data: 1\n"), std::string::npos);
  EXPECT_EQ(text.find("data: 2\n"), std::string::npos);
  EXPECT_NE(text.find("data: 3\n"), std::string::npos);
}

TEST(EventHub, ReplaysMissedEvents) {
  EventHub hub;
  const auto first = hub.subscribe().value();
  hub.publish("x", "1");
  const std::string seen = id_of(drain(*first));
  hub.publish("x", "2");
  hub.publish("x", "3");
  const std::string missed = drain(*hub.subscribe(seen).value());
  EXPECT_EQ(missed.find("data: 1\n"), std::string::npos);
  EXPECT_NE(missed.find("data: 2\n"), std::string::npos);
  EXPECT_NE(missed.find("data: 3\n"), std::string::npos);
  EXPECT_EQ(drain(*hub.subscribe(id_of(missed)).value()), "");
}

TEST(EventHub, UnknownIdRestartsClient) {
  EventHub hub({.backlog_bytes = 100});
  const auto first = hub.subscribe().value();
  hub.publish("x", "1");
  const std::string seen = id_of(drain(*first));
  for (int i = 0; i < 20; ++i) hub.publish("x", "2");
  for (const std::string& id :
       {seen, std::string("00000000-3"), std::string("nonsense"), seen + "999", std::string("-")}) {
    const auto source = hub.subscribe(id).value();
    hub.publish("x", "4");
    const std::string text = drain(*source);
    EXPECT_TRUE(text.starts_with("event: reset\n")) << id << text;
    EXPECT_NE(text.find("data: 4\n"), std::string::npos);
  }
}

TEST(EventHub, DropsFullQueueOnce) {
  EventHub hub({.queue_bytes = 200});
  const auto slow = hub.subscribe().value();
  int woken = 0;
  slow->on_wake([&] { ++woken; });
  for (int i = 0; i < 50; ++i) hub.publish("x", "0123456789");
  EXPECT_TRUE(slow->must_close());
  EXPECT_EQ(hub.counts().dropped_clients, 1U);
  EXPECT_EQ(hub.counts().subscribers, 0U);
  EXPECT_EQ(woken, 2);  // for the first event and for the end
  std::string text;
  EXPECT_EQ(slow->pull(text), StreamSource::Next::abort);
  EXPECT_EQ(text, "");
}

TEST(EventHub, SlowClientsGetNewestState) {
  EventHub hub({.queue_bytes = 1000});
  const auto slow = hub.subscribe().value();
  for (int i = 0; i < 500; ++i) {
    for (const char* robot : {"a", "b"}) hub.publish("state", std::to_string(i), robot, EventHub::Of::state);
    if (i == 100) hub.publish("mission", "ended", "a");
  }
  EXPECT_EQ(hub.counts().dropped_clients, 0U);
  const std::string text = drain(*slow);
  const auto of_mission = text.find("data: ended\n");
  EXPECT_NE(of_mission, std::string::npos);
  const auto first = text.find("event: state\n"), second = text.find("event: state\n", first + 1);
  EXPECT_LT(of_mission, first);
  EXPECT_EQ(text.find("event: state\n", second + 1), std::string::npos) << text;
  EXPECT_NE(text.find("data: 499\n", second), std::string::npos);
  hub.publish("state", "500", "a", EventHub::Of::state);
  EXPECT_NE(drain(*slow).find("data: 500\n"), std::string::npos);
}

TEST(EventHub, EscapesLineBreaks) {
  EventHub hub;
  const auto source = hub.subscribe().value();
  hub.publish("x\ndata: forged", "{}\n\nevent: forged", "");
  const std::string text = drain(*source);
  EXPECT_EQ(text.find("\ndata: forged"), std::string::npos);
  EXPECT_EQ(text.find("\nevent: forged"), std::string::npos);
}

TEST(EventHub, BoundsSubscribers) {
  EventHub hub({.max_subscribers = 2});
  auto a = hub.subscribe().value();
  const auto b = hub.subscribe().value();
  const auto refused = hub.subscribe();
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().fault, Fault::unavailable);
  a.reset();
  EXPECT_TRUE(hub.subscribe().has_value());
}

TEST(EventHub, LimitsClientToQuarter) {
  EventHub hub({.max_subscribers = 8});
  const auto of = [&hub](const char* client) { return hub.subscribe("", "", client); };
  std::vector<std::shared_ptr<StreamSource>> held;
  for (const char* client : {"a", "b", "c", "d"}) {
    for (int k = 0; k < 2; ++k) held.push_back(of(client).value());
    EXPECT_EQ(of(client).error().fault, Fault::unavailable);
  }
  const auto ended = [](StreamSource& source) {
    std::string text;
    return source.pull(text) == StreamSource::Next::end;
  };
  held.push_back(of("e").value());
  EXPECT_TRUE(ended(*held[0])) << "the oldest stream of the client with most";
  held.push_back(of("e").value());
  EXPECT_TRUE(ended(*held[2]));
  EXPECT_FALSE(of("e"));
  EXPECT_EQ(std::ranges::count_if(held, [&](const auto& each) { return ended(*each); }), 2);
  EXPECT_EQ(hub.counts().subscribers, 8U);
}

TEST(EventHub, EndsStreamsOnDestruction) {
  auto hub = std::make_unique<EventHub>();
  const auto source = hub->subscribe().value();
  hub->publish("x", "1");
  hub.reset();
  std::string text;
  EXPECT_EQ(source->pull(text), StreamSource::Next::end);
  EXPECT_NE(text.find("data: 1"), std::string::npos);
}

TEST(EventHub, KeepsEventsOfManyPublishers) {
  EventHub hub({.queue_bytes = 64 * 1024 * 1024});
  const auto source = hub.subscribe().value();
  std::vector<std::thread> publishers;
  for (int p = 0; p < 4; ++p) {
    publishers.emplace_back([&] {
      for (int i = 0; i < 1000; ++i) hub.publish("x", "1");
    });
  }
  std::string text;
  for (auto& publisher : publishers) publisher.join();
  source->pull(text);
  std::size_t last = 0;
  std::size_t events = 0;
  for (std::size_t at = text.find("-"); at != std::string::npos; at = text.find("-", at + 1), ++events) {
    const std::size_t number = std::stoul(text.substr(at + 1));
    EXPECT_EQ(number, last + 1);
    last = number;
  }
  EXPECT_EQ(events, 4000U);
}

}  // namespace
}  // namespace joulecast::http
