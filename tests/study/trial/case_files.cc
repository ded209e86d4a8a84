#include "tests/study/trial/case_files.h"

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>
#include <variant>

#include "base/text_file.h"
#include "client/files.h"
#include "signals/sample.h"
#include "telemetry/codec.h"
#include "telemetry/event_log.h"

namespace joulecast::trial {
namespace {

using nlohmann::json;
namespace vr = virtual_robot;

class Digest {
 public:
  void add(std::span<const char> bytes) {
    for (const char byte : bytes) {
      value_ ^= static_cast<unsigned char>(byte);
      value_ *= 0x100000001B3ULL;
    }
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325ULL;
};

Result<void> digest_file(Digest& digest, const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::array<char, 1 << 16> block{};
  while (in) {
    in.read(block.data(), block.size());
    digest.add({block.data(), static_cast<std::size_t>(in.gcount())});
  }
  if (!in.eof()) return fail(Fault::unavailable, path.string(), "cannot be read");
  return {};
}

// Strength and shapes of one effect under the names that the catalogue gives them.
json catalogue_values(const std::string& id, double strength, const vr::SimulationSpec& spec) {
  const vr::World& w = spec.world;
  json values = json::array();
  const auto add = [&](const char* name, double value) { values.push_back({name, value}); };
  add("strength", strength);
  if (id == "floor_resistance_zone") {
    add("x_m", w.zone_x_m);
    add("y_m", w.zone_y_m);
    add("radius_m", w.zone_radius_m);
  } else if (id == "slope") {
    add("uphill_rad", w.slope_direction_rad);
  } else if (id == "friction_asymmetry") {
    add("side", w.weak_side);
  } else if (id == "stribeck_friction") {
    add("speed_rad_s", w.stribeck_speed_m_s / spec.robot.wheel_radius_m);
    add("exponent", w.stribeck_power);
  } else if (id == "torque_constant_loss") {
    add("voltage_share", w.emf_loss_share);
  } else if (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain") {
    add("motors", w.motor_sensor_share);
    add("battery", w.battery_sensor_share);
  } else if (id == "winding_temperature") {
    add("time_constant_s", w.thermal_time_constant_s);
  }
  return values;
}

std::string truth_text(const TrialCase& c) {
  json effects = json::array();
  for (const auto& [id, strength] : vr::effects_of(c.spec.imperfections)) {
    effects.push_back({{"id", id}, {"values", catalogue_values(id, strength, c.spec)}});
  }
  const json truth{{"case", c.index},
                   {"kind", name_of(c.kind)},
                   {"strength", name_of(c.strength)},
                   {"robot", c.robot_kind},
                   {"seed", c.seed},
                   {"added_gap", c.added_gap},
                   {"missions", c.spec.missions},
                   {"rate_hz", c.spec.rate_hz},
                   {"motor_channels", c.spec.sensors.motor_channels},
                   {"variants", c.variants},
                   {"effects", effects}};
  return truth.dump(2) + "\n";
}

Result<void> write_log(const TrialCase& c, const std::filesystem::path& path) {
  auto log = telemetry::EventLogWriter::create(path.string());
  if (!log) return tl::unexpected(log.error());
  vr::VirtualRobot robot(c.spec, c.seed);
  while (auto emission = robot.next()) {
    const auto* sample = std::get_if<signals::Sample>(&emission->message);
    const std::string& id = robot.robot_id();
    const auto bytes = sample != nullptr ? telemetry::encode_telemetry(id, *sample)
                                         : telemetry::encode_mission_event(
                                               id, std::get<signals::MissionEvent>(emission->message));
    if (!bytes) return tl::unexpected(bytes.error());
    const auto subject =
        sample != nullptr ? telemetry::Subject::telemetry : telemetry::Subject::mission_event;
    if (auto done = log->write(emission->utime_us, telemetry::channel_of(subject, id), *bytes); !done) {
      return done;
    }
  }
  return log->close();
}

}  // namespace

Result<std::uint64_t> drive_case(const TrialCase& c, const CaseFiles& files) {
  std::error_code failed;
  std::filesystem::create_directories(files.folder, failed);
  if (failed) return fail(Fault::unavailable, files.folder.string(), "cannot be made: " + failed.message());
  if (auto done = write_text_file(files.robot().string(), c.robot_json, Existing::replace); !done)
    return tl::unexpected(done.error());
  if (auto done = write_log(c, files.log()); !done) return tl::unexpected(done.error());
  if (auto done = write_text_file(files.truth().string(), truth_text(c), Existing::replace); !done)
    return tl::unexpected(done.error());
  return digest_of(files);
}

Result<std::uint64_t> digest_of_files(const std::vector<std::filesystem::path>& paths) {
  Digest digest;
  for (const auto& path : paths) {
    if (auto done = digest_file(digest, path); !done) return tl::unexpected(done.error());
  }
  return digest.value();
}

Result<std::uint64_t> digest_of(const CaseFiles& files) {
  return digest_of_files({files.robot(), files.log(), files.truth()});
}

Result<SealedTruth> open_truth(const std::filesystem::path& path) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  const json document = json::parse(*text, nullptr, false);
  if (document.is_discarded()) return fail(Fault::corrupt, path.string(), "is not JSON");
  try {
    SealedTruth truth;
    const auto kind = kind_of(document.at("kind").get<std::string>());
    if (!kind) return fail(Fault::corrupt, path.string() + "#/kind", "is no kind of case");
    truth.kind = *kind;
    truth.robot_kind = document.at("robot").get<std::string>();
    truth.motor_channels = document.at("motor_channels").get<bool>();
    truth.variants = document.at("variants").get<std::vector<std::string>>();
    truth.added_gap = document.at("added_gap").get<double>();
    const auto strength = document.at("strength").get<std::string>();
    for (const Strength s : {Strength::slight, Strength::weak, Strength::medium, Strength::strong}) {
      if (strength == name_of(s)) truth.strength = s;
    }
    for (const json& effect : document.at("effects")) {
      truth.effects.push_back({effect.at("id").get<std::string>(),
                               effect.at("values").get<std::vector<std::pair<std::string, double>>>()});
    }
    return truth;
  } catch (const json::exception& e) {
    return fail(Fault::corrupt, path.string(), e.what());
  }
}

}  // namespace joulecast::trial
