#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "telemetry/covariates.h"
#include "telemetry/sample.h"

// The only door between datagrams and the rest: every length that a datagram declares is checked against the
// datagram before LCM's generated decoder runs, because that decoder trusts them.
// Decoding judges form only; whether the values make sense is validation.h's question.
namespace joulecast::telemetry {

// LCM refuses channels over 63 characters, of which "ROBOT_TELEMETRY." takes 16.
inline constexpr std::size_t max_robot_id_length = 47;
inline constexpr std::size_t max_covariates_robot_id_length = 46;  // "ROBOT_COVARIATES." takes 17
inline constexpr std::size_t max_mission_id_length = 128;
inline constexpr std::size_t max_note_length = 1024;

// Ids travel in LCM channels, URLs and file names: letters, digits, '.', '_' and '-', one character at least.
[[nodiscard]] bool is_valid_robot_id(std::string_view id) noexcept;
[[nodiscard]] bool is_valid_mission_id(std::string_view id) noexcept;

struct DecodedTelemetry {
  std::string robot_id;
  Sample sample;
};

struct DecodedMissionEvent {
  std::string robot_id;
  MissionEvent event;
};

struct DecodedCovariates {
  std::string robot_id;
  CovariateMessage message;
};

// energy_state_t, free of LCM. Energies in J since the mission began, leaving the battery positive; NaN = not
// known.
struct EnergyState {
  std::int64_t utime_us = 0;
  std::string robot_id;
  std::string mission_id;  // empty: no mission open
  std::int64_t model_version = 0;
  double measured_power_w = unmeasured;
  double modelled_power_w = unmeasured;
  double measured_energy_j = unmeasured;
  double modelled_energy_j = unmeasured;
  double unexplained_energy_j = unmeasured;
  double recovered_energy_j = unmeasured;
  double state_of_charge = unmeasured;  // 0 to 1
  double state_of_charge_sd = unmeasured;
  double range_m = unmeasured;  // median
  std::array<double, 2> range_band_m{unmeasured, unmeasured};
  double run_time_s = unmeasured;  // median
  std::array<double, 2> run_time_band_s{unmeasured, unmeasured};
  std::array<double, 2> winding_temperature_c{unmeasured, unmeasured};
};

// Fault::corrupt with the offending field when the bytes are not exactly one message of the type.
[[nodiscard]] Result<DecodedTelemetry> decode_telemetry(std::span<const std::uint8_t> bytes);
[[nodiscard]] Result<DecodedMissionEvent> decode_mission_event(std::span<const std::uint8_t> bytes);
[[nodiscard]] Result<DecodedCovariates> decode_covariates(std::span<const std::uint8_t> bytes);
[[nodiscard]] Result<EnergyState> decode_energy_state(std::span<const std::uint8_t> bytes);

// Bytes that the matching decode accepts; Fault::invalid naming the string or count that breaks its limit.
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_telemetry(std::string_view robot_id,
                                                                 const Sample& sample);
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_mission_event(std::string_view robot_id,
                                                                     const MissionEvent& event);
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_covariates(std::string_view robot_id,
                                                                  const CovariateMessage& message);
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_energy_state(const EnergyState& state);

// What a channel of the contract carries, and whose it is.
enum class Subject { telemetry, mission_event, covariates, energy_state };

struct ChannelName {
  Subject subject;
  std::string_view robot_id;  // points into the channel given
};

[[nodiscard]] std::string channel_of(Subject subject, std::string_view robot_id);
// Empty for a channel that is none of ours or whose suffix is no robot id.
[[nodiscard]] std::optional<ChannelName> parse_channel(std::string_view channel) noexcept;
// Regular expression (as LCM subscribes by) of a subject's channels for every robot.
[[nodiscard]] std::string channel_pattern(Subject subject);

}  // namespace joulecast::telemetry
