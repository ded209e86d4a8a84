#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "access/robot_keys.h"
#include "base/host_clock.h"
#include "base/overloaded.h"
#include "base/text.h"
#include "base/text_file.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "client/commands/listen.h"
#include "client/commands/option.h"
#include "client/commands/print.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/interrupt.h"
#include "client/progress.h"
#include "client/virtual_robot/fleet.h"
#include "signals/ids.h"
#include "signals/sample.h"
#include "telemetry/codec.h"
#include "telemetry/event_log.h"
#include "telemetry/lcm_link.h"

namespace joulecast::client {
namespace {

using Clock = std::chrono::steady_clock;
namespace vr = virtual_robot;

struct SimulateOptions : vr::ScriptOptions, vr::Charger, vr::SensorSuite {
  SimulateOptions() {
    pickup_share = 0.3;
    sampling_jitter = 0.05;
  }
  std::optional<std::size_t> robots;
  std::uint64_t seed = 1;
  std::optional<std::string> lcm_url;  // absent: only the log is written
  std::string log, truth, key_file, server;
  std::string start = "2023-11-14T22:13:20Z";  // used only for logs
  double rate_hz = 50, speed = 1, run_s = 0, scatter = 1, initial_charge = 0.8;
  int missions = 0;
  std::vector<std::string> robot_files, effects;
  bool no_motor_channels = false, no_gyro = false, no_pose = false;
  bool list_effects = false, quiet = false, force = false;
};

// A robot file with the id of its robot in this fleet.
struct FleetMember {
  std::string json_text;
  vr::SimulationSpec spec;
};

Result<std::vector<vr::EffectStrength>> parse_effects(const std::vector<std::string>& texts) {
  std::vector<vr::EffectStrength> result;
  for (const auto& text : texts) {
    const std::size_t equals = text.find('=');
    const auto strength = to_number<double>(equals == std::string::npos ? "" : text.substr(equals + 1));
    if (!strength)
      return invalid("--effect", "must be id=strength, is " + text + "; --list-effects lists ids and units");
    result.emplace_back(text.substr(0, equals), *strength);
  }
  return result;
}

Result<FleetMember> make_member(const std::string& source, const std::string& text,
                                const std::optional<std::string>& id) {
  auto document = nlohmann::json::parse(text, nullptr, false);
  if (id && document.is_object()) document["robot_id"] = *id;
  FleetMember member{document.is_discarded() ? text : document.dump(), {}};
  auto robot = vr::parse_robot(member.json_text);
  if (!robot) return fail(robot.error().fault, source + "#" + robot.error().field, robot.error().message);
  member.spec.robot = std::move(*robot);
  return member;
}

std::string numbered(const std::string& kind, std::size_t index) {
  std::string number = std::to_string(index + 1);
  if (number.size() < 2) number.insert(0, "0");
  return kind + "-" + number;
}

// The given files (each once under its own id where no more robots are wanted), or the shipped kinds in turn.
Result<std::vector<FleetMember>> assemble(const SimulateOptions& options) {
  TRY_ASSIGN(auto effects, parse_effects(options.effects));
  TRY_ASSIGN(const auto imperfections, vr::make_imperfections(effects));

  std::vector<FleetMember> members;
  vr::Rng world_rng = vr::Rng::stream(options.seed, 1);
  const vr::World floor = vr::draw_world(world_rng, vr::ScriptOptions{}.map_half_width_m);
  for (std::size_t k = 0; k < *options.robots; ++k) {
    std::string source;
    std::string text;
    if (options.robot_files.empty()) {
      const auto shipped = vr::shipped_robots();
      source = std::string(shipped[k % shipped.size()].kind);
      text = std::string(shipped[k % shipped.size()].json_text);
    } else {
      source = options.robot_files[k % options.robot_files.size()];
      TRY_ASSIGN(text, read_text_file(source));
    }
    TRY_ASSIGN(auto member, make_member(source, text, std::nullopt));
    if (options.robot_files.empty() || *options.robots != options.robot_files.size()) {
      TRY_ASSIGN(member, make_member(source, text, numbered(member.spec.robot.robot_id, k)));
    }
    const std::string& id = member.spec.robot.robot_id;
    if (!signals::is_valid_robot_id(id))
      return invalid(source + "#/robot_id", "\"" + id + "\" is no robot id");
    if (std::any_of(members.begin(), members.end(),
                    [&](const FleetMember& m) { return m.spec.robot.robot_id == id; }))
      return invalid("robot", "two robots are called " + id);
    vr::SimulationSpec& spec = member.spec;
    spec.imperfections = imperfections;
    spec.world = floor;
    spec.rate_hz = options.rate_hz;
    spec.missions = options.missions;
    spec.scatter = options.scatter;
    spec.script = options;
    spec.charger = options;
    spec.sensors = options;
    spec.sensors.motor_channels = !options.no_motor_channels;
    spec.sensors.gyro = !options.no_gyro;
    spec.sensors.pose = !options.no_pose;
    spec.initial_charge = options.initial_charge;
    members.push_back(std::move(member));
  }
  return members;
}

Result<void> introduce(const std::vector<FleetMember>& members, const std::string& server) {
  for (const auto& member : members)
    TRY(ask(server, HttpMethod::put, robot_target(member.spec.robot.robot_id), member.json_text, {},
            accept_json, std::chrono::seconds(5)));
  return {};
}

struct Outlets {
  access::RobotKeys keys;
  std::map<std::string, std::int64_t> sequences;  // of each channel, the last
  std::optional<telemetry::LcmLink> link;
  std::optional<telemetry::EventLogWriter> log;
  std::optional<OutputFile> log_file;

  Result<void> send(const std::string& robot_id, const vr::Emission& emission) {
    const Overloaded encode{
        [&](const signals::MissionEvent& event) { return telemetry::encode_mission_event(robot_id, event); },
        [&](const signals::Sample& sample) { return telemetry::encode_telemetry(robot_id, sample); },
        [&](const signals::CovariateMessage& values) {
          return telemetry::encode_covariates(robot_id, values);
        }};
    TRY_ASSIGN(const auto bytes, std::visit(encode, emission.message));
    constexpr telemetry::Subject subjects[] = {telemetry::Subject::mission_event,
                                               telemetry::Subject::telemetry, telemetry::Subject::covariates};
    const std::string channel = telemetry::channel_of(subjects[emission.message.index()], robot_id);
    if (link) {
      const auto key = keys.find(robot_id);
      TRY(key == keys.end() ? link->publish(channel, bytes) : publish_signed(channel, bytes, key->second));
    }
    if (log) TRY(log->write(emission.utime_us, channel, bytes));
    return {};
  }

  Result<void> publish_signed(const std::string& channel, std::span<const std::uint8_t> bytes,
                              std::string_view key) {
    std::int64_t& sequence = sequences[channel];
    const std::int64_t now = host_utime_us();
    sequence = std::max(sequence + 1, now);
    TRY_ASSIGN(const auto proven, telemetry::sign(channel, {now, sequence, bytes, {}}, key));
    return link->publish(channel, proven);
  }
};

void print_effects() {
  for (const auto& entry : vr::all_effects())
    fmt::print("{:<26} {:<10} up to {:g}{}\n", entry.id, entry.unit, entry.search_limit,
               entry.outside ? "  (outside the catalogue)" : "");
}

Result<void> write_truth(const SimulateOptions& options, const std::vector<FleetMember>& members,
                         const vr::Fleet& fleet) {
  if (options.truth.empty()) return {};
  std::vector<vr::Truth> truths;
  for (std::size_t k = 0; k < members.size(); ++k) {
    const vr::SimulationSpec& spec = members[k].spec;
    truths.push_back({spec.robot.robot_id, options.seed, vr::effects_of(spec.imperfections), spec.world,
                      fleet.robot(k).finished()});
  }
  return write_text_file(options.truth, vr::truth_json(truths), existing(options.force));
}

// Of missions in order of time: when they are run by the clock, the UTC second at which they start; in a log,
// which comes out the same again, the seed.
std::string name_of_run(const SimulateOptions& options, std::int64_t start_us) {
  if (!options.lcm_url) return "s" + std::to_string(options.seed);
  return format_utc(start_us, "%y%m%d-%H%M%S");
}

// Robot time from the first message to the last.
double length_s(const std::vector<vr::SimulationSpec>& specs, const SimulateOptions& options) {
  if (options.run_s > 0) return options.run_s;
  vr::Fleet rehearsal(specs, options.seed);
  std::int64_t last_us = specs.front().start_utime_us;
  while (const auto message = rehearsal.next()) last_us = message->emission.utime_us;
  return 1e-6 * static_cast<double>(last_us - specs.front().start_utime_us);
}

Result<void> check_options(const SimulateOptions& options) {
  const bool over_lcm = options.lcm_url.has_value();
  const bool endless = options.run_s == 0 && options.missions == 0;
  if (!over_lcm && endless) return invalid("--log", "a log needs an end: give --duration or --missions");
  if (over_lcm && options.speed == 0)
    return invalid("--speed", "0 (unpaced) requires --log alone; LCM receivers would lose messages");
  if (over_lcm && options.speed > 1 && endless)
    return invalid(
        "--speed",
        "above 1 needs an end, so that no stamp lies in the future: give --duration or --missions");
  for (const auto& [flag, file] : {std::pair{"--log", &options.log}, {"--truth", &options.truth}})
    TRY(may_write(flag, *file, existing(options.force)));
  return {};
}

Result<Outlets> open_outlets(const SimulateOptions& options) {
  Outlets outlets;
  if (!options.log.empty()) {
    TRY_ASSIGN(auto file, OutputFile::create(options.log, existing(options.force)));
    TRY_ASSIGN(outlets.log, telemetry::EventLogWriter::create(file.written_to()));
    outlets.log_file.emplace(std::move(file));
  }
  if (options.lcm_url) {
    TRY_ASSIGN(outlets.link, telemetry::LcmLink::open(*options.lcm_url));
  }
  if (!options.key_file.empty()) {
    TRY_ASSIGN(outlets.keys, access::read_robot_keys(options.key_file));
  }
  return outlets;
}

std::vector<vr::SimulationSpec> timed_specs(const std::vector<FleetMember>& members,
                                            const SimulateOptions& options, std::int64_t start_us) {
  std::vector<vr::SimulationSpec> specs;
  for (const FleetMember& member : members) specs.push_back(member.spec);
  if (options.lcm_url) {
    // Robots with a faster clock start in the past, so that their last stamp is the time at which it is sent.
    const double ahead_s = options.speed > 1 ? (1 - 1 / options.speed) * length_s(specs, options) : 0;
    start_us = host_utime_us() - std::llround(1e6 * ahead_s);
  }
  for (vr::SimulationSpec& spec : specs) {
    spec.start_utime_us = start_us;
    spec.run = name_of_run(options, start_us);
  }
  return specs;
}

void announce(const std::vector<vr::SimulationSpec>& specs, const std::string& lcm_url) {
  for (const auto& spec : specs)
    fmt::print("{}: {:g} kg, up to {:g} m/s, {:g} V\n", spec.robot.robot_id,
               spec.robot.chassis_kg + 2 * spec.robot.wheel_kg, spec.robot.speed_limit_m_s,
               spec.robot.nominal_voltage_v);
  fmt::print("publishing on {}; ctrl-C stops\n", lcm_url);
  std::fflush(stdout);
}

struct Published {
  std::uint64_t messages = 0;
  double robot_time_s = 0;
};

// Publishes messages in order of time, over LCM at the given speed, until the end, the duration or ctrl-C.
Result<Published> publish(vr::Fleet& fleet, std::int64_t start_us, const SimulateOptions& options,
                          Outlets& outlets) {
  InterruptGuard interrupt;
  Published sent;
  Progress progress("simulating", "s of robot time", static_cast<std::uint64_t>(options.run_s));
  const auto began = Clock::now();
  while (auto message = fleet.next()) {
    const double at_s = 1e-6 * static_cast<double>(message->emission.utime_us - start_us);
    if (options.run_s > 0 && at_s >= options.run_s) break;
    if (outlets.link) {
      const auto due = began + std::chrono::duration_cast<Clock::duration>(
                                   std::chrono::duration<double>(at_s / options.speed));
      if (interrupt.wait_until(due)) break;
    } else if (sent.messages % 1024 == 0 && interrupt.interrupted()) {
      break;
    }
    TRY(outlets.send(fleet.robot(message->robot).robot_id(), message->emission));
    sent.robot_time_s = at_s;
    progress.reach(static_cast<std::uint64_t>(at_s));
    ++sent.messages;
  }
  for (const auto& message : fleet.abort())
    TRY(outlets.send(fleet.robot(message.robot).robot_id(), message.emission));
  if (outlets.log) {
    TRY(outlets.log->close());
    TRY(outlets.log_file->commit());
  }
  return sent;
}

Result<void> run_simulate(const SimulateOptions& options) {
  TRY(check_options(options));
  TRY_ASSIGN(const auto start_utime_us, parse_time(options.start, "--start"));
  TRY_ASSIGN(auto members, assemble(options));
  TRY_ASSIGN(auto outlets, open_outlets(options));
  if (!options.server.empty()) TRY(introduce(members, options.server));
  const std::vector<vr::SimulationSpec> specs = timed_specs(members, options, start_utime_us);
  vr::Fleet fleet(specs, options.seed);
  if (!options.quiet && options.lcm_url) announce(specs, *options.lcm_url);
  const auto began = Clock::now();
  TRY_ASSIGN(const auto sent, publish(fleet, specs.front().start_utime_us, options, outlets));
  TRY(write_truth(options, members, fleet));
  if (!options.quiet) {
    std::size_t missions = 0;
    for (std::size_t k = 0; k < fleet.size(); ++k) missions += fleet.robot(k).finished().size();
    const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();
    fmt::print("{} of {}, {} finished, {:.1f} s of robot time in {:.1f} s\n",
               count_of(sent.messages, "message"), count_of(fleet.size(), "robot"),
               count_of(missions, "mission"), sent.robot_time_s, wall_s);
  }
  return {};
}

Result<Exit> simulate(SimulateOptions& options) {
  if (options.list_effects) {
    print_effects();
    return Exit::ok;
  }
  constexpr std::size_t usual_robots = 4;
  if (!options.robots)
    options.robots = options.robot_files.empty() ? usual_robots : options.robot_files.size();
  if (options.log.empty() && !options.lcm_url) options.lcm_url = usual_lcm_url();
  TRY(run_simulate(options));
  return Exit::ok;
}

}  // namespace

void add_simulate(CLI::App& program, Exit& exit) {
  using O = SimulateOptions;
  add_command<O>(
      program, exit, "simulate", "Run a fleet of virtual robots that publish telemetry", simulate,
      {{"--robots", &O::robots, "number of robots; default: 4, or one of each --robot", between(1, 10'000)},
       {"--robot", &O::robot_files, "robot file; repeatable; default: the shipped kinds in turn",
        file_of("json")},
       {"--seed", &O::seed, "the same seed gives the same robots, missions and noise"},
       {"--lcm-url", &O::lcm_url,
        "LCM provider to publish on; default: JOULECAST_LCM_URL, or that of joulecastd", named("URL")},
       {"--log", &O::log, "write an LCM event log; without --lcm-url nothing is published",
        file_of("lcmlog")},
       {"--key-file", &O::key_file,
        "sign the telemetry of robots that have a key in this file of joulecast key", file_of("json")},
       {"--truth", &O::truth, "write the simulated effects and true energies of the robots as JSON",
        file_of("json")},
       {"--force", &O::force, "overwrite existing files of --log and --truth"},
       {"--server", &O::server, "send the robot files to this joulecastd first, http://host:port",
        named("URL")},
       {"--rate", &O::rate_hz, "telemetry of each robot, Hz", between(1.0, 200.0)},
       {"--speed", &O::speed,
        "robot seconds in one second; 0 = unpaced, with --log alone. Above 1 the robots' clocks begin in the "
        "past, so that no stamp lies in the future",
        not_negative()},
       {"--start", &O::start,
        "with --log alone: when the robots begin, UTC (2026-11-16T08:00:00Z) or microseconds since 1970",
        time_value(), Needs{"--log"}, Excludes{"--lcm-url"}},
       {"--duration", &O::run_s, "robot seconds to run; 0 = until stopped", not_negative()},
       {"--missions", &O::missions, "missions of each robot; 0 = without end", not_negative()},
       {"--mission-duration", &vr::ScriptOptions::duration_s, "approximate duration of a mission, s",
        positive()},
       {"--effect", &O::effects, "imperfection of the robots, id=strength; repeatable",
        named("EFFECT=STRENGTH")},
       {"--list-effects", &O::list_effects, "print the effects with their units and exit"},
       {"--scatter", &O::scatter, "size of the differences between missions, 0 = none", not_negative()},
       {"--jitter", &O::sampling_jitter, "jitter of the sampling times, as a fraction of the period",
        between(0.0, 0.45)},
       {"--loss", &O::loss_probability, "probability that a sample is lost", between(0.0, 0.99)},
       {"--pickups", &O::pickup_share, "fraction of the halts at which the payload changes",
        between(0.0, 1.0)},
       {"--undeclared", &O::undeclared_share, "fraction of the missions with an undeclared payload",
        between(0.0, 1.0)},
       {"--charge-below", &O::below,
        "charge below which a robot charges between missions; 0 = packs below 0.25 are exchanged there",
        between(0.0, 1.0)},
       {"--charge-rate", &O::rate_per_h, "charging rate, as a fraction of the capacity an hour",
        between(0.05, 10.0)},
       {"--initial-charge", &O::initial_charge, "charge at the beginning", between(0.05, 1.0)},
       {"--manoeuvre", &O::manoeuvre,
        "every mission is the calibration drive: straight, at nine constant speeds"},
       {"--no-motor-channels", &O::no_motor_channels, "robots without motor voltage and current"},
       {"--no-gyro", &O::no_gyro, "robots without gyro"},
       {"--no-pose", &O::no_pose, "robots without localisation"},
       {"--temperature", &O::temperature, "robots with winding temperature sensors"},
       {"--pitch", &O::pitch, "robots with an inclinometer"},
       {"--covariates", &O::covariates_hz, "rate of the covariates cpu_load and height_m, Hz; 0 = none",
        between(0.0, 200.0)},
       {"--quiet", &O::quiet, "no summary"}},
      "joulecast simulate --robots 4 --mission-duration 20 --duration 3 --server http://127.0.0.1:8080\n"
      "joulecast simulate --robot amr.json --robots 1 --missions 3 --speed 0 --log simulated.lcmlog\n"
      "joulecast simulate --list-effects");
}

}  // namespace joulecast::client
