#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "history/chunk_codec.h"

namespace joulecast::history {
namespace {

using signals::Sample;

// All bits of a sample, member by member.
std::array<std::uint64_t, 20> bits(const Sample& s) {
  const auto b = [](double value) { return std::bit_cast<std::uint64_t>(value); };
  return {static_cast<std::uint64_t>(s.utime_us),
          static_cast<std::uint64_t>(s.sequence),
          b(s.wheel_velocity_rad_s[0]),
          b(s.wheel_velocity_rad_s[1]),
          b(s.motor_voltage_v[0]),
          b(s.motor_voltage_v[1]),
          b(s.motor_current_a[0]),
          b(s.motor_current_a[1]),
          b(s.battery_voltage_v),
          b(s.battery_current_a),
          b(s.velocity_command[0]),
          b(s.velocity_command[1]),
          b(s.yaw_rate_rad_s),
          b(s.pitch_rad),
          b(s.pose[0]),
          b(s.pose[1]),
          b(s.pose[2]),
          b(s.motor_temperature_c[0]),
          b(s.motor_temperature_c[1]),
          b(s.payload_kg)};
}

// The bits of everything a sample can hold are covered: a member added to Sample must be added above and to
// the layout.
static_assert(sizeof(Sample) == 20 * 8);

void expect_round_trip(const std::vector<Sample>& samples, int level) {
  const auto decoded = decode_chunk(encode_chunk(samples, level));
  ASSERT_TRUE(decoded) << describe(decoded.error());
  ASSERT_EQ(decoded->size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(bits((*decoded)[i]), bits(samples[i])) << i;
}

// Any 64 bits, with the odd values of doubles and integers more often than chance has them.
std::uint64_t any_bits() {
  return *rc::gen::oneOf(
      rc::gen::arbitrary<std::uint64_t>(),
      rc::gen::element<std::uint64_t>(
          0, std::uint64_t{1} << 63, std::bit_cast<std::uint64_t>(std::numeric_limits<double>::quiet_NaN()),
          std::bit_cast<std::uint64_t>(std::numeric_limits<double>::signaling_NaN()) | 0x123,
          std::bit_cast<std::uint64_t>(-std::numeric_limits<double>::infinity()),
          std::bit_cast<std::uint64_t>(std::numeric_limits<double>::denorm_min()),
          std::numeric_limits<std::uint64_t>::max()));
}

Sample any_sample() {
  std::array<std::uint64_t, 20> words{};
  for (auto& word : words) word = any_bits();
  return std::bit_cast<Sample>(words);
}

RC_GTEST_PROP(TelemetryChunk, RestoresSamplesExactly, ()) {
  const auto count = *rc::gen::inRange<std::size_t>(1, 40);
  std::vector<Sample> samples;
  for (std::size_t i = 0; i < count; ++i) samples.push_back(any_sample());
  const auto decoded = decode_chunk(encode_chunk(samples, *rc::gen::element(1, 3)));
  RC_ASSERT(decoded.has_value());
  RC_ASSERT(decoded->size() == samples.size());
  for (std::size_t i = 0; i < count; ++i) RC_ASSERT(bits((*decoded)[i]) == bits(samples[i]));
}

RC_GTEST_PROP(TelemetryChunk, ReportsAnyFlippedBit, ()) {
  std::vector<Sample> samples;
  for (int i = 0; i < 20; ++i) samples.push_back(any_sample());
  auto bytes = encode_chunk(samples, 1);
  const auto at = *rc::gen::inRange<std::size_t>(0, bytes.size());
  bytes[at] ^= static_cast<std::byte>(1 << *rc::gen::inRange(0, 8));
  const auto decoded = decode_chunk(bytes);
  // Some bits of a zstd header are unused; then the samples must be unchanged.
  if (decoded) {
    RC_ASSERT(decoded->size() == samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) RC_ASSERT(bits((*decoded)[i]) == bits(samples[i]));
  } else {
    RC_ASSERT(decoded.error().fault == Fault::corrupt);
  }
}

RC_GTEST_PROP(TelemetryChunk, SurvivesArbitraryBytes, ()) {
  auto bytes = *rc::gen::arbitrary<std::vector<std::uint8_t>>();
  if (!bytes.empty() && *rc::gen::arbitrary<bool>()) bytes.front() = 1;
  const auto decoded = decode_chunk(std::as_bytes(std::span(bytes)));
  RC_ASSERT(!decoded.has_value());
  RC_ASSERT(decoded.error().fault == Fault::corrupt);
}

TEST(TelemetryChunk, RestoresTheLargestChunk) {
  std::vector<Sample> samples(max_chunk_samples);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].utime_us = static_cast<std::int64_t>(i * i);
    samples[i].battery_voltage_v = 24 + std::sin(0.01 * static_cast<double>(i));
  }
  expect_round_trip(samples, 1);
}

TEST(TelemetryChunk, RefusesEveryTruncation) {
  const auto bytes = encode_chunk(std::vector<Sample>(3), 1);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto decoded = decode_chunk(std::span(bytes).first(size));
    ASSERT_FALSE(decoded) << size;
    EXPECT_EQ(decoded.error().fault, Fault::corrupt);
  }
}

TEST(TelemetryChunk, CompressesConstantAndUnmeasuredChannels) {
  std::vector<Sample> samples(1024);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].utime_us = 1'700'000'000'000'000 + 10'000 * static_cast<std::int64_t>(i);
    samples[i].sequence = static_cast<std::int64_t>(i);
  }
  // Steady time and sequence take two bytes a sample before compression, the 18 constant columns 9 bytes
  // each: the compressed rest is far below a byte a sample.
  EXPECT_LT(encode_chunk(samples, 3).size(), samples.size() / 2);
}

}  // namespace
}  // namespace joulecast::history
