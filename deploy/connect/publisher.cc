// Publishes a robot's telemetry and announces one mission, in C++.
//   lcm-gen -x --cpp-hpath generated lcmtypes/*.lcm
//   g++ -std=c++20 -Igenerated deploy/connect/publisher.cc -o publisher -llcm -lcrypto
//   ./publisher amr 5          (robot_id, seconds)
// Messages are signed if the environment variable ROBOT_KEY contains the robot's key, as printed by
// `joulecast key create`. The drive below is invented: replace it by your readings.
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "joulecast/mission_event_t.hpp"
#include "joulecast/robot_covariates_t.hpp"
#include "joulecast/robot_telemetry_t.hpp"
#include "joulecast/signed_message_t.hpp"

namespace {

constexpr double not_measured = std::numeric_limits<double>::quiet_NaN();
constexpr int rate_hz = 50;

std::int64_t now_us() {
  using namespace std::chrono;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

// Publishes messages, signed if there is a key.
class Signer {
 public:
  Signer(lcm::LCM& lcm, const std::string& key_hex) : lcm_(lcm), sequence_(now_us()) {
    for (std::size_t k = 0; k + 1 < key_hex.size(); k += 2)
      key_.push_back(static_cast<std::uint8_t>(std::stoi(key_hex.substr(k, 2), nullptr, 16)));
  }

  template <class Message>
  void publish(const std::string& channel, const Message& message) {
    if (key_.empty()) {
      lcm_.publish(channel, &message);
      return;
    }
    joulecast::signed_message_t proven{};
    proven.utime = now_us();
    proven.sequence = ++sequence_;  // increases across restarts of the program
    proven.size = message.getEncodedSize();
    proven.content.resize(static_cast<std::size_t>(proven.size));
    message.encode(proven.content.data(), 0, proven.size);
    std::vector<std::uint8_t> text(channel.begin(), channel.end());
    text.push_back(0);
    for (const std::int64_t number : {proven.utime, proven.sequence})
      for (int shift = 56; shift >= 0; shift -= 8)
        text.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(number) >> shift));
    text.insert(text.end(), proven.content.begin(), proven.content.end());
    HMAC(EVP_sha256(), key_.data(), static_cast<int>(key_.size()), text.data(), text.size(), proven.mac,
         nullptr);
    lcm_.publish(channel, &proven);
  }

 private:
  lcm::LCM& lcm_;
  std::vector<std::uint8_t> key_;
  std::int64_t sequence_;
};

joulecast::mission_event_t mission_event(const std::string& robot_id, const std::string& mission_id,
                                         std::int8_t event) {
  joulecast::mission_event_t m{};
  m.utime = now_us();
  m.robot_id = robot_id;
  m.mission_id = mission_id;
  m.event = event;
  m.payload_mass = 20;  // kg, the declared load
  m.note = "first mission";
  return m;
}

joulecast::robot_telemetry_t read_sensors(const std::string& robot_id, std::int64_t sequence) {
  const double t_s = static_cast<double>(sequence) / rate_hz;
  joulecast::robot_telemetry_t s{};
  s.utime = now_us();     // the instant of sampling, not of sending
  s.sequence = sequence;  // +1 a message, so that losses can be counted
  s.robot_id = robot_id;
  const double speed_m_s = std::min(0.5 * t_s, 1.0);
  for (int side = 0; side < 2; ++side) {  // [0] right, [1] left
    s.wheel_velocity[side] = speed_m_s / 0.08;
    s.motor_voltage[side] = not_measured;
    s.motor_current[side] = not_measured;
    s.motor_temperature[side] = not_measured;
  }
  s.battery_voltage = 26.0;
  s.battery_current = 1.0 + 2.0 * speed_m_s;  // positive while discharging
  s.velocity_command[0] = speed_m_s;
  s.velocity_command[1] = 0;
  s.yaw_rate = 0;
  s.pitch = not_measured;
  s.pose[0] = s.pose[1] = s.pose[2] = not_measured;
  s.payload_mass = 20;
  return s;
}

// Other quantities that may explain the power; a value is valid until the next one of its name.
joulecast::robot_covariates_t covariates(const std::string& robot_id,
                                         const std::vector<std::pair<std::string, double>>& values) {
  joulecast::robot_covariates_t c{};
  c.utime = now_us();
  c.robot_id = robot_id;
  c.n = static_cast<std::int32_t>(values.size());
  for (const auto& [name, value] : values) {
    c.name.push_back(name);
    c.value.push_back(value);
  }
  return c;
}

double cpu_load() {
  double load = not_measured;
  getloadavg(&load, 1);
  return load / std::thread::hardware_concurrency();
}

}  // namespace

int main(int argc, char** argv) {
  const std::string robot_id = argc > 1 ? argv[1] : "amr";
  const int duration_s = argc > 2 ? std::atoi(argv[2]) : 5;
  lcm::LCM lcm;  // the provider of LCM_DEFAULT_URL
  if (!lcm.good()) {
    std::fprintf(stderr, "LCM is not reachable; set LCM_DEFAULT_URL\n");
    return 1;
  }
  const char* key = std::getenv("ROBOT_KEY");
  Signer signer(lcm, key != nullptr ? key : "");
  using joulecast::mission_event_t;
  const std::string mission_id = "tour-" + std::to_string(now_us());
  const auto started = mission_event(robot_id, mission_id, mission_event_t::STARTED);
  signer.publish("MISSION_EVENT." + robot_id, started);
  const auto around = covariates(robot_id, {{"surface=concrete", 1}, {"heater_w", 0}});
  signer.publish("ROBOT_COVARIATES." + robot_id, around);
  auto next = std::chrono::steady_clock::now();
  for (std::int64_t sequence = 0; sequence < std::int64_t{rate_hz} * duration_s; ++sequence) {
    if (sequence % rate_hz == 0) {
      const auto load = covariates(robot_id, {{"cpu_load", cpu_load()}});
      signer.publish("ROBOT_COVARIATES." + robot_id, load);
    }
    const auto sample = read_sensors(robot_id, sequence);
    signer.publish("ROBOT_TELEMETRY." + robot_id, sample);
    std::this_thread::sleep_until(next += std::chrono::milliseconds(1000 / rate_hz));
  }
  const auto finished = mission_event(robot_id, mission_id, mission_event_t::FINISHED);
  signer.publish("MISSION_EVENT." + robot_id, finished);
  std::printf("%s drove mission %s\n", robot_id.c_str(), mission_id.c_str());
}
