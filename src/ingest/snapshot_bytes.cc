#include "ingest/snapshot_bytes.h"

#include <array>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <type_traits>

namespace joulecast::ingest {
namespace {

// Grows with every change of what follows.
constexpr std::uint32_t layout = 1;

template <class T>
concept Plain = std::is_arithmetic_v<T> || std::is_enum_v<T>;

template <class Archive>
void members(Archive& a, Contradiction& c) {
  a(c.kind, c.id, c.channel, c.value, c.says, c.untrue, c.told_utime_us);
}

template <class Archive>
void members(Archive& a, battery::Seen& seen) {
  a(seen.count, seen.mean, seen.variance);
}

template <class Archive>
void members(Archive& a, ChargeView& c) {
  battery::ChargeEstimate& e = c.estimate;
  a(e.charge, e.sd, e.source, e.default_curve, e.flat_curve, e.current_bias_a, e.current_bias_sd_a);
  battery::ChargingStay& s = c.stay;
  a(c.phase, s.start_utime_us, s.end_utime_us, s.start_charge, s.charged_ah, s.charged_j, s.complete);
  a(c.to_full.duration_s, c.to_full.sd_s);
  a(c.habit.current_a, c.habit.taper_charge, c.habit.taper_time_s, c.habit.end_current_a);
}

template <class Archive>
void members(Archive& a, signals::Accounts& c) {
  a(c.battery_j, c.measured_j, c.measured_s, c.measured_motor_j, c.motor_measured_s, c.modelled_j,
    c.modelled_motor_j, c.drawn_j, c.returned_j, c.charge_ah, c.distance_m, c.turned_rad, c.duration_s,
    c.ledger.value);
}

template <class Archive>
void members(Archive& a, signals::Sample& c) {
  a(c.utime_us, c.sequence);
  signals::visit_fields(c, [&a](const signals::SampleField&, double& number) { a(number); });
}

template <class Archive>
void members(Archive& a, RobotSnapshot& s) {
  a(s.robot_id, s.has_model, s.model_version, s.received_utime_us, s.sample, s.measured_power_w,
    s.modelled_power_w, s.speed_m_s, s.yaw_rate_rad_s, s.state_of_charge, s.charge, s.winding_temperature_c,
    s.mission_id, s.mission_key, s.mission_start_utime_us, s.accounts, s.drawn_j, s.returned_j,
    s.ledger.value, s.samples, s.faults, s.fault_notes, s.contradictions, s.missions_left_out);
}

class Saver {
 public:
  explicit Saver(std::vector<std::byte>& out) : out_(out) {}
  template <class... T>
  void operator()(T&... values) {
    (put(values), ...);
  }

 private:
  template <Plain T>
  void put(T value) {
    const auto* bytes = reinterpret_cast<const std::byte*>(&value);
    out_.insert(out_.end(), bytes, bytes + sizeof(T));
  }
  void put(const std::string& text) {
    put(static_cast<std::uint32_t>(text.size()));
    const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
    out_.insert(out_.end(), bytes, bytes + text.size());
  }
  template <class T, std::size_t n>
  void put(std::array<T, n>& values) {
    for (T& value : values) put(value);
  }
  template <class T>
  void put(std::vector<T>& values) {
    put(static_cast<std::uint32_t>(values.size()));
    for (T& value : values) put(value);
  }
  template <class T>
  void put(std::map<std::string, T>& values) {
    put(static_cast<std::uint32_t>(values.size()));
    for (auto& [name, value] : values) {
      put(name);
      put(value);
    }
  }
  template <class T>
  requires(std::is_class_v<T> && !std::same_as<T, std::string>) void put(T& value) { members(*this, value); }

  std::vector<std::byte>& out_;
};

// After the bytes have run out everything reads as empty, and whole() is false.
class Loader {
 public:
  explicit Loader(std::span<const std::byte> rest) : rest_(rest) {}
  template <class... T>
  void operator()(T&... values) {
    (get(values), ...);
  }
  bool whole() const { return sound_ && rest_.empty(); }

 private:
  bool take(void* into, std::size_t size) {
    sound_ = sound_ && size <= rest_.size();
    if (!sound_) return false;
    if (size > 0) std::memcpy(into, rest_.data(), size);
    rest_ = rest_.subspan(size);
    return true;
  }
  std::uint32_t count() {
    std::uint32_t number = 0;
    if (!take(&number, sizeof(number)) || number > rest_.size()) {
      sound_ = false;
      return 0;
    }
    return number;
  }
  template <Plain T>
  void get(T& value) {
    if constexpr (std::same_as<T, bool>) {
      std::uint8_t byte = 0;
      (void)take(&byte, 1);
      value = byte != 0;
    } else {
      (void)take(&value, sizeof(T));
    }
  }
  void get(std::string& text) {
    text.resize(count());
    (void)take(text.data(), text.size());
  }
  template <class T, std::size_t n>
  void get(std::array<T, n>& values) {
    for (T& value : values) get(value);
  }
  template <class T>
  void get(std::vector<T>& values) {
    for (std::uint32_t left = count(); left > 0 && sound_; --left) get(values.emplace_back());
  }
  template <class T>
  void get(std::map<std::string, T>& values) {
    for (std::uint32_t left = count(); left > 0 && sound_; --left) {
      std::string name;
      get(name);
      get(values[name]);
    }
  }
  template <class T>
  requires(std::is_class_v<T> && !std::same_as<T, std::string>) void get(T& value) { members(*this, value); }

  std::span<const std::byte> rest_;
  bool sound_ = true;
};

}  // namespace

std::vector<std::byte> snapshot_bytes(const RobotSnapshot& snapshot) {
  std::vector<std::byte> bytes;
  Saver save(bytes);
  std::uint32_t version = layout;
  RobotSnapshot copy = snapshot;
  save(version, copy);
  return bytes;
}

std::shared_ptr<const RobotSnapshot> snapshot_from_bytes(std::span<const std::byte> bytes) {
  Loader load(bytes);
  std::uint32_t version = 0;
  load(version);
  if (version != layout) return nullptr;
  auto snapshot = std::make_shared<RobotSnapshot>();
  load(*snapshot);
  return load.whole() ? snapshot : nullptr;
}

}  // namespace joulecast::ingest
