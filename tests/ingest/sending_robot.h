#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "ingest/pipeline.h"
#include "tests/ingest/harness.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::ingest {

using signals::MissionEvent;
using signals::MissionPhase;
using signals::Sample;
using testing::PipelineHarness;

// One mission of a robot of this kind, with or without the channels of its motors.
inline made::Robot drive(std::string_view kind, bool motors, std::uint64_t seed, double length_s = 40) {
  return made::virtual_robot(kind, seed, [&](virtual_robot::SimulationSpec& spec) {
    spec.missions = 1;
    spec.rate_hz = 50;
    spec.script.duration_s = length_s;
    spec.sensors.motor_channels = motors;
  });
}

struct Sent {
  std::vector<Contradiction> live;  // at the mission's end
  std::vector<history::Mission> missions;
  std::vector<history::Event> events;
  std::vector<std::string> warnings;
  std::uint64_t counted = 0;

  const Contradiction* find(ContradictionKind kind, std::string_view channel) const {
    const auto found = std::ranges::find_if(live, [&](const Contradiction& c) {
      return c.kind == kind && c.channel.find(channel) != std::string::npos;
    });
    return found == live.end() ? nullptr : &*found;
  }
  std::string told() const {
    std::string text;
    for (const Contradiction& c : live) text += (c.untrue ? "X " : "  ") + c.id + ": " + c.says + "\n";
    return text;
  }
};

// `alter` makes the mistake with each sample on its way.
class Robot {
 public:
  explicit Robot(made::Robot robot) : made_(std::move(robot)) {
    SessionSettings settings;
    settings.max_ahead_us = 600'000'000;
    harness = std::make_unique<PipelineHarness>(settings);
    harness->add_robot(made_.model);
  }

  using Alter = std::function<void(InboundMessage&, Sample&)>;
  Sent send(const Alter& alter = {}, std::optional<std::uint32_t> second_sender = {}) {
    const std::string& id = made_.model.robot_id;
    const telemetry::Recording& mission = made_.recordings.missions.front();
    const telemetry::Sender own{0x0a000005, 40'000};
    const std::int64_t begin_us = mission.samples.front().utime_us, end_us = mission.samples.back().utime_us;
    const auto event = [&](MissionPhase phase, std::int64_t at_us) {
      InboundMessage message{id, Sample{}, at_us, own};
      Sample clock;
      clock.utime_us = at_us;
      if (alter) alter(message, clock);
      message.content = MissionEvent{clock.utime_us, mission.mission_id, phase, mission.payload_kg, ""};
      harness->pipeline->handle(message);
    };
    event(MissionPhase::started, begin_us - 1000);
    for (const Sample& s : mission.samples) {
      InboundMessage message{id, s, s.utime_us, own};
      Sample altered = s;
      if (alter) alter(message, altered);
      if (!std::holds_alternative<RefusedMessage>(message.content)) message.content = altered;
      harness->pipeline->handle(message);
      if (!second_sender) continue;
      Sample other = s;
      other.sequence += 70'000;
      other.utime_us += 3'000;
      harness->pipeline->handle({id, other, s.utime_us + 3'000, {*second_sender, 41'000}});
    }
    event(MissionPhase::finished, end_us + 1000);
    harness->pipeline->tick(end_us + 1'000'000);
    harness->pipeline->publish();
    Sent sent;
    sent.live = harness->fleet.find(id)->contradictions;
    sent.missions = harness->missions();
    sent.events = *harness->store->events(0, 1000);
    sent.warnings = harness->warnings;
    for (const auto& count : harness->counters.contradictions) sent.counted += count;
    return sent;
  }

  const robot::RobotModel& model() const { return made_.model; }
  std::unique_ptr<PipelineHarness> harness;

 private:
  made::Robot made_;
};

}  // namespace joulecast::ingest
