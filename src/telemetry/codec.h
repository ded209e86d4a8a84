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
#include "signals/covariates.h"
#include "signals/ids.h"
#include "signals/sample.h"

// The only entry of datagrams into the program: every length that a datagram declares is checked against the
// datagram before LCM's generated decoder runs, because that decoder trusts them. Decoding checks the form
// only; validation.h checks the values.
namespace joulecast::telemetry {

// LCM refuses channels over 63 characters, of which "ROBOT_COVARIATES." takes 17.
inline constexpr std::size_t max_covariates_robot_id_length = 46;

struct DecodedTelemetry {
  std::string robot_id;
  signals::Sample sample;
};

struct DecodedMissionEvent {
  std::string robot_id;
  signals::MissionEvent event;
};

struct DecodedCovariates {
  std::string robot_id;
  signals::CovariateMessage message;
};

// Fault::corrupt with the offending field when the bytes are not exactly one message of the type.
[[nodiscard]] Result<DecodedTelemetry> decode_telemetry(std::span<const std::uint8_t> bytes);
[[nodiscard]] Result<DecodedMissionEvent> decode_mission_event(std::span<const std::uint8_t> bytes);
[[nodiscard]] Result<DecodedCovariates> decode_covariates(std::span<const std::uint8_t> bytes);
[[nodiscard]] Result<signals::EnergyState> decode_energy_state(std::span<const std::uint8_t> bytes);

// Bytes that the matching decode accepts; Fault::invalid naming the string or count that breaks its limit.
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_telemetry(std::string_view robot_id,
                                                                 const signals::Sample& sample);
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_mission_event(std::string_view robot_id,
                                                                     const signals::MissionEvent& event);
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_covariates(std::string_view robot_id,
                                                                  const signals::CovariateMessage& message);
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_energy_state(const signals::EnergyState& state);

// A message with proof of its sender; `content` are the bytes of the message itself.
struct SignedMessage {
  std::int64_t utime_us = 0;
  std::int64_t sequence = 0;
  std::span<const std::uint8_t> content;
  std::array<std::uint8_t, 32> mac{};
};

[[nodiscard]] bool is_signed(std::span<const std::uint8_t> bytes);
// Points into `bytes`. The decoders above accept signed messages and decode their content; is_authentic()
// checks the signature.
[[nodiscard]] Result<SignedMessage> decode_signed(std::span<const std::uint8_t> bytes);
[[nodiscard]] Result<std::vector<std::uint8_t>> encode_signed(const SignedMessage& message);

// Proof of a message's sender: HMAC-SHA-256 under the robot's key, as specified in signed_message_t.lcm.

// The bytes of the message signed for that channel; its previous `mac` is ignored.
[[nodiscard]] Result<std::vector<std::uint8_t>> sign(std::string_view channel, SignedMessage message,
                                                     std::string_view key);

// Whether the message was signed for that channel with that key.
[[nodiscard]] bool is_authentic(std::string_view channel, const SignedMessage& message, std::string_view key);

// The content and the robot of a channel of the contract.
enum class Subject { telemetry, mission_event, covariates, energy_state };

struct ChannelName {
  Subject subject;
  std::string_view robot_id;  // points into the channel given
};

[[nodiscard]] std::string channel_of(Subject subject, std::string_view robot_id);
// Empty for a channel that is not part of the contract or has a suffix that is no robot id.
[[nodiscard]] std::optional<ChannelName> parse_channel(std::string_view channel) noexcept;
// Regular expression (as LCM subscribes by) of a subject's channels for every robot.
[[nodiscard]] std::string channel_pattern(Subject subject);

}  // namespace joulecast::telemetry
