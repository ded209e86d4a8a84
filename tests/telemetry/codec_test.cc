#include "telemetry/codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <joulecast/energy_state_t.hpp>
#include <joulecast/mission_event_t.hpp>
#include <joulecast/robot_covariates_t.hpp>
#include <joulecast/robot_telemetry_t.hpp>
#include <limits>

#include "samples.h"
#include "signals/ids.h"
#include "signals/sample.h"

namespace joulecast::telemetry {
namespace {

using test::distinct_sample;
using test::same_bits;
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t telemetry_text =
    24;  // fingerprint, utime and sequence precede the length of the robot id

Bytes telemetry_bytes() {
  return encode_telemetry("amr-07", distinct_sample()).value();
}

Bytes mission_bytes() {
  return encode_mission_event("amr-07", {5, "m-1", signals::MissionPhase::finished, 3.5, "über die Rampe"})
      .value();
}

Bytes covariate_bytes() {
  return encode_covariates("amr-07",
                           {5, {{"cpu_load", 0.25}, {"surface=ice", 1}, {"height_m", signals::unmeasured}}})
      .value();
}

Bytes state_bytes() {
  signals::EnergyState state;
  state.robot_id = "amr-07";
  state.mission_id = "m-1";
  state.range_m = 1200;
  return encode_energy_state(state).value();
}

void put_length(Bytes& bytes, std::size_t at, std::uint32_t length) {
  for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(length >> (24 - 8 * i));
}

template <class Message>
Message generated_decode(const Bytes& bytes) {
  Message message;
  EXPECT_EQ(message.decode(bytes.data(), 0, static_cast<int>(bytes.size())), static_cast<int>(bytes.size()));
  return message;
}

TEST(Codec, MatchesGeneratedClass) {
  const signals::Sample s = distinct_sample();
  const auto m = generated_decode<robot_telemetry_t>(telemetry_bytes());
  EXPECT_EQ(m.utime, s.utime_us);
  EXPECT_EQ(m.sequence, s.sequence);
  EXPECT_EQ(m.robot_id, "amr-07");
  EXPECT_THAT(m.wheel_velocity, ::testing::ElementsAre(1.25, -2.5));
  EXPECT_THAT(m.motor_voltage, ::testing::ElementsAre(3, 4));
  EXPECT_THAT(m.motor_current, ::testing::ElementsAre(5, 6));
  EXPECT_EQ(m.battery_voltage, 24.5);
  EXPECT_EQ(m.battery_current, -7);
  EXPECT_THAT(m.velocity_command, ::testing::ElementsAre(0.75, -0.125));
  EXPECT_EQ(m.yaw_rate, 0.375);
  EXPECT_THAT(m.pitch, ::testing::IsNan());
  EXPECT_THAT(m.pose, ::testing::ElementsAre(10, -11, 2));
  EXPECT_EQ(m.motor_temperature[0], 55);
  EXPECT_EQ(m.payload_mass, 12.5);
}

TEST(Codec, TelemetryRoundTripIsExact) {
  const auto decoded = decode_telemetry(telemetry_bytes());
  ASSERT_TRUE(decoded) << describe(decoded.error());
  EXPECT_EQ(decoded->robot_id, "amr-07");
  EXPECT_TRUE(same_bits(decoded->sample, distinct_sample()));
}

TEST(Codec, MissionEventRoundTrip) {
  const auto m = generated_decode<mission_event_t>(mission_bytes());
  EXPECT_EQ(int{m.event}, int{mission_event_t::FINISHED});
  const auto decoded = decode_mission_event(mission_bytes());
  ASSERT_TRUE(decoded) << describe(decoded.error());
  EXPECT_EQ(decoded->robot_id, "amr-07");
  EXPECT_EQ(decoded->event.utime_us, 5);
  EXPECT_EQ(decoded->event.mission_id, "m-1");
  EXPECT_EQ(decoded->event.phase, signals::MissionPhase::finished);
  EXPECT_EQ(decoded->event.payload_kg, 3.5);
  EXPECT_EQ(decoded->event.note, "über die Rampe");
}

TEST(Codec, CovariatesRoundTrip) {
  const auto m = generated_decode<robot_covariates_t>(covariate_bytes());
  EXPECT_EQ(m.utime, 5);
  EXPECT_EQ(m.robot_id, "amr-07");
  EXPECT_THAT(m.name, ::testing::ElementsAre("cpu_load", "surface=ice", "height_m"));
  EXPECT_THAT(m.value, ::testing::ElementsAre(0.25, 1, ::testing::IsNan()));
  const auto decoded = decode_covariates(covariate_bytes());
  ASSERT_TRUE(decoded) << describe(decoded.error());
  EXPECT_EQ(decoded->robot_id, "amr-07");
  EXPECT_EQ(decoded->message.utime_us, 5);
  ASSERT_EQ(decoded->message.covariates.size(), 3u);
  EXPECT_EQ(decoded->message.covariates[0], (signals::Covariate{"cpu_load", 0.25}));
  EXPECT_EQ(decoded->message.covariates[1], (signals::Covariate{"surface=ice", 1}));
  EXPECT_TRUE(std::isnan(decoded->message.covariates[2].value));
  EXPECT_TRUE(decode_covariates(encode_covariates("a", {}).value()));  // an empty list is valid
}

TEST(Codec, RejectsCovariatesBeyondLimits) {
  signals::CovariateMessage message;
  for (std::size_t k = 0; k < signals::max_covariates; ++k)
    message.covariates.push_back({"c" + std::to_string(k), 1});
  ASSERT_TRUE(decode_covariates(encode_covariates("a", message).value()));
  message.covariates.push_back({"one_more", 1});
  EXPECT_EQ(encode_covariates("a", message).error().field, "n");
  EXPECT_TRUE(encode_covariates(std::string(max_covariates_robot_id_length, 'a'), {}));
  EXPECT_EQ(encode_covariates(std::string(max_covariates_robot_id_length + 1, 'a'), {}).error().field,
            "robot_id");
  const std::string part(signals::max_covariate_name_length, 'a');
  for (const std::string& name : {part, part + "=" + part, std::string("a.b_c-9=Z")})
    EXPECT_TRUE(encode_covariates("a", {0, {{name, 1}}})) << name;
  for (const std::string& name :
       {std::string(), part + "a", "a=" + part + "a", std::string("="), std::string("a="), std::string("=a"),
        std::string("a=b=c"), std::string("a b"), std::string("\xC3\xA4"), std::string("a\0b", 3)}) {
    EXPECT_EQ(encode_covariates("a", {0, {{"b", 1}, {name, 1}}}).error().field, "name[1]") << name;
  }
}

// A generated decoder would allocate and read n elements without a check.
TEST(Codec, RejectsHostileCounts) {
  constexpr std::size_t count_at = 8 + 8 + 4 + 7;
  for (const std::uint32_t count : {65u, 1000u, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFFu}) {
    Bytes bytes = covariate_bytes();
    put_length(bytes, count_at, count);
    EXPECT_EQ(decode_covariates(bytes).error().field, "n") << count;
  }
  for (const std::uint32_t count : {4u, 64u}) {  // more names than there are
    Bytes bytes = covariate_bytes();
    put_length(bytes, count_at, count);
    EXPECT_EQ(decode_covariates(bytes).error().field, "name[3]") << count;
  }
  Bytes fewer = covariate_bytes();
  put_length(fewer, count_at, 2);
  EXPECT_EQ(decode_covariates(fewer).error().fault, Fault::corrupt);
  constexpr std::size_t name_at = count_at + 4;
  for (const std::uint32_t length : {0u, 97u, 0x7FFFFFFFu, 0xFFFFFFFFu}) {
    Bytes bytes = covariate_bytes();
    put_length(bytes, name_at, length);
    EXPECT_EQ(decode_covariates(bytes).error().field, "name[0]") << length;
  }
}

TEST(Codec, EnergyStateRoundTrip) {
  signals::EnergyState state{7, "amr-07", "",   3, 1,       2, 3,       4,       5,
                             6, 0.5,      0.01, 8, {6, 10}, 9, {7, 11}, {10, 11}};
  const auto bytes = encode_energy_state(state);
  ASSERT_TRUE(bytes);
  const auto m = generated_decode<energy_state_t>(*bytes);
  EXPECT_EQ(m.recovered_energy, 6);
  EXPECT_EQ(m.winding_temperature[1], 11);
  const auto decoded = decode_energy_state(*bytes);
  ASSERT_TRUE(decoded) << describe(decoded.error());
  EXPECT_EQ(decoded->utime_us, 7);
  EXPECT_EQ(decoded->mission_id, "");
  EXPECT_EQ(decoded->model_version, 3);
  EXPECT_EQ(decoded->measured_power_w, 1);
  EXPECT_EQ(decoded->modelled_power_w, 2);
  EXPECT_EQ(decoded->measured_energy_j, 3);
  EXPECT_EQ(decoded->modelled_energy_j, 4);
  EXPECT_EQ(decoded->unexplained_energy_j, 5);
  EXPECT_EQ(decoded->recovered_energy_j, 6);
  EXPECT_EQ(decoded->state_of_charge, 0.5);
  EXPECT_EQ(decoded->range_m, 8);
  EXPECT_EQ(decoded->run_time_s, 9);
  EXPECT_EQ(decoded->state_of_charge_sd, 0.01);
  EXPECT_EQ(decoded->range_band_m, (std::array<double, 2>{6, 10}));
  EXPECT_EQ(decoded->run_time_band_s, (std::array<double, 2>{7, 11}));
  EXPECT_EQ(decoded->winding_temperature_c, (std::array<double, 2>{10, 11}));
}

// Rejected: every proper prefix, every message followed by bytes, and every other type.
template <class Decode>
void expect_exact_size(const Bytes& whole, Decode decode) {
  ASSERT_TRUE(decode(whole));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const auto decoded = decode(part);
    ASSERT_FALSE(decoded) << "a prefix of " << size << " bytes was accepted";
    EXPECT_EQ(decoded.error().fault, Fault::corrupt);
  }
  Bytes longer = whole;
  longer.push_back(0);
  const auto decoded = decode(longer);
  ASSERT_FALSE(decoded);
  EXPECT_EQ(decoded.error().fault, Fault::corrupt);
}

TEST(Codec, RejectsEveryTruncation) {
  expect_exact_size(telemetry_bytes(), [](const Bytes& b) { return decode_telemetry(b); });
  expect_exact_size(mission_bytes(), [](const Bytes& b) { return decode_mission_event(b); });
  expect_exact_size(state_bytes(), [](const Bytes& b) { return decode_energy_state(b); });
  expect_exact_size(covariate_bytes(), [](const Bytes& b) { return decode_covariates(b); });
}

TEST(Codec, RejectsOtherTypes) {
  EXPECT_EQ(decode_telemetry(mission_bytes()).error().field, "fingerprint");
  EXPECT_EQ(decode_mission_event(telemetry_bytes()).error().field, "fingerprint");
  EXPECT_EQ(decode_energy_state(mission_bytes()).error().field, "fingerprint");
  EXPECT_EQ(decode_covariates(mission_bytes()).error().field, "fingerprint");
}

TEST(Codec, RejectsHostileLengths) {
  for (const std::uint32_t length : {0u, 1u, 6u, 8u, 100u, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFFu}) {
    Bytes bytes = telemetry_bytes();
    put_length(bytes, telemetry_text, length);
    const auto decoded = decode_telemetry(bytes);
    ASSERT_FALSE(decoded) << length;
    EXPECT_EQ(decoded.error().fault, Fault::corrupt);
    EXPECT_EQ(decoded.error().field, "robot_id");
  }
}

TEST(Codec, RejectsUnterminatedStrings) {
  Bytes bytes = telemetry_bytes();
  bytes[telemetry_text + 4 + 6] = 'x';
  EXPECT_EQ(decode_telemetry(bytes).error().field, "robot_id");
}

TEST(Codec, RejectsInvalidIds) {
  for (const char bad : {'\0', '/', ' ', '\n', '\x80', '*'}) {
    Bytes bytes = telemetry_bytes();
    bytes[telemetry_text + 4 + 2] = static_cast<std::uint8_t>(bad);
    EXPECT_FALSE(decode_telemetry(bytes)) << static_cast<int>(bad);
  }
  EXPECT_TRUE(signals::is_valid_robot_id(std::string(signals::max_robot_id_length, 'a')));
  EXPECT_FALSE(signals::is_valid_robot_id(std::string(signals::max_robot_id_length + 1, 'a')));
  EXPECT_FALSE(signals::is_valid_robot_id(""));
  EXPECT_EQ(encode_telemetry("a b", {}).error().field, "robot_id");
  EXPECT_EQ(encode_mission_event("a", {0, "", signals::MissionPhase::started, 0, ""}).error().field,
            "mission_id");
  EXPECT_EQ(encode_mission_event("a", {0, "m", signals::MissionPhase::started, 0, "\xC0\xAF"}).error().field,
            "note");
}

TEST(Codec, RejectsUnknownPhasesAndNotes) {
  const std::size_t phase_at = 8 + 8 + (4 + 7) + (4 + 4);
  for (const int phase : {0, 4, 127, 128, 255}) {
    Bytes bytes = mission_bytes();
    bytes[phase_at] = static_cast<std::uint8_t>(phase);
    EXPECT_EQ(decode_mission_event(bytes).error().field, "event") << phase;
  }
  Bytes bytes = mission_bytes();
  bytes[bytes.size() - 3] = 0xFF;
  EXPECT_EQ(decode_mission_event(bytes).error().field, "note");
}

// For each value of each byte the message is rejected, or decodes to content that encodes to the same bytes.
template <class Decode, class Encode>
void expect_any_byte_change_survived(const Bytes& whole, Decode decode, Encode encode) {
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (int value = 0; value < 256; ++value) {
      Bytes bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(value);
      const auto decoded = decode(bytes);
      if (!decoded) continue;
      const auto again = encode(*decoded);
      ASSERT_TRUE(again);
      EXPECT_EQ(*again, bytes) << "byte " << at << " = " << value;
    }
  }
}

TEST(Codec, SurvivesAnyByteChange) {
  expect_any_byte_change_survived(
      mission_bytes(), [](const Bytes& b) { return decode_mission_event(b); },
      [](const DecodedMissionEvent& d) { return encode_mission_event(d.robot_id, d.event); });
  expect_any_byte_change_survived(
      covariate_bytes(), [](const Bytes& b) { return decode_covariates(b); },
      [](const DecodedCovariates& d) { return encode_covariates(d.robot_id, d.message); });
}

TEST(Codec, AnySampleRoundTrips) {
  EXPECT_TRUE(rc::check([] {
    signals::Sample s;
    s.utime_us = *rc::gen::arbitrary<std::int64_t>();
    s.sequence = *rc::gen::arbitrary<std::int64_t>();
    const auto real = [] { return std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>()); };
    s.wheel_velocity_rad_s = {real(), real()};
    s.motor_current_a = {real(), real()};
    s.pose = {real(), real(), real()};
    s.payload_kg = real();
    const auto id = *rc::gen::resize(
        40, rc::gen::nonEmpty(rc::gen::container<std::string>(rc::gen::elementOf(std::string("azAZ09._-")))));
    const auto bytes = encode_telemetry(id, s);
    RC_ASSERT(bytes.has_value());
    const auto decoded = decode_telemetry(*bytes);
    RC_ASSERT(decoded.has_value());
    RC_ASSERT(decoded->robot_id == id);
    RC_ASSERT(same_bits(decoded->sample, s));
  }));
}

TEST(Codec, ArbitraryBytesReencodeExactly) {
  EXPECT_TRUE(rc::check([](Bytes tail) {
    Bytes bytes = telemetry_bytes();
    bytes.resize(telemetry_text);
    bytes.insert(bytes.end(), tail.begin(), tail.end());
    const auto decoded = decode_telemetry(bytes);
    if (decoded.has_value()) RC_ASSERT(encode_telemetry(decoded->robot_id, decoded->sample).value() == bytes);
  }));
}

TEST(Channel, ParsesItsOwnNames) {
  for (const Subject subject :
       {Subject::telemetry, Subject::mission_event, Subject::covariates, Subject::energy_state}) {
    const std::string channel = channel_of(subject, "r2.d2_x-1");
    const auto parsed = parse_channel(channel);
    ASSERT_TRUE(parsed);
    EXPECT_EQ(parsed->subject, subject);
    EXPECT_EQ(parsed->robot_id, "r2.d2_x-1");
  }
  EXPECT_EQ(channel_of(Subject::telemetry, "a"), "ROBOT_TELEMETRY.a");
  EXPECT_FALSE(parse_channel("ROBOT_TELEMETRY."));
  EXPECT_FALSE(parse_channel("ROBOT_TELEMETRY.a b"));
  EXPECT_FALSE(parse_channel("ROBOT_TELEMETRYxa"));
  EXPECT_FALSE(parse_channel("OTHER.a"));
  EXPECT_FALSE(parse_channel(""));
}

}  // namespace
}  // namespace joulecast::telemetry
