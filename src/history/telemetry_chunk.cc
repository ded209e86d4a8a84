#include "history/telemetry_chunk.h"

#include <array>
#include <bit>
#include <cassert>
#include <cstdint>

#include "history/chunk_bytes.h"

namespace joulecast::history {
namespace {

using telemetry::Sample;

constexpr std::byte format{1};
constexpr std::size_t double_columns = 18;
// No sample takes more than two varints and its doubles; the columns' first bytes and the count come on top.
constexpr std::size_t max_plain_bytes =
    max_chunk_samples * (2 * max_varint_bytes + 8 * double_columns) + double_columns * 9 + max_varint_bytes;

// Visits the doubles of a sample, const or not, in the order of the layout.
template <class S, class Visit>
void visit_doubles(S& s, Visit visit) {
  std::size_t column = 0;
  for (auto* pair : {&s.wheel_velocity_rad_s, &s.motor_voltage_v, &s.motor_current_a})
    for (auto& value : *pair) visit(column++, value);
  visit(column++, s.battery_voltage_v);
  visit(column++, s.battery_current_a);
  for (auto& value : s.velocity_command) visit(column++, value);
  visit(column++, s.yaw_rate_rad_s);
  visit(column++, s.pitch_rad);
  for (auto& value : s.pose) visit(column++, value);
  for (auto& value : s.motor_temperature_c) visit(column++, value);
  visit(column++, s.payload_kg);
  assert(column == double_columns);
}

constexpr std::array integer_columns{&Sample::utime_us, &Sample::sequence};

tl::unexpected<Error> corrupt(std::string message) {
  return fail(Fault::corrupt, "telemetry chunk", std::move(message));
}

}  // namespace

std::vector<std::byte> encode_chunk(std::span<const Sample> samples, int level) {
  assert(!samples.empty() && samples.size() <= max_chunk_samples);
  Bytes plain;
  plain.reserve(samples.size() * (8 * double_columns + 4) + 16);
  put_varint(plain, samples.size());
  std::vector<std::int64_t> integers(samples.size());
  for (const auto member : integer_columns) {
    for (std::size_t i = 0; i < samples.size(); ++i) integers[i] = samples[i].*member;
    put_integers(plain, integers);
  }
  std::array<std::vector<std::uint64_t>, double_columns> columns;
  for (auto& column : columns) column.reserve(samples.size());
  for (const Sample& sample : samples)
    visit_doubles(sample, [&](std::size_t column, const double& value) {
      columns[column].push_back(std::bit_cast<std::uint64_t>(value));
    });
  for (const auto& column : columns) put_doubles(plain, column);
  Bytes out{format};
  append_compressed(out, plain, level);
  return out;
}

Result<std::vector<Sample>> decode_chunk(std::span<const std::byte> bytes) {
  if (bytes.empty() || bytes.front() != format) return corrupt("unknown format");
  auto plain = decompressed(bytes.subspan(1), max_plain_bytes, "telemetry chunk");
  if (!plain) return tl::unexpected(plain.error());
  ByteReader reader(*plain);
  const auto count = reader.varint();
  if (!count || *count == 0 || *count > max_chunk_samples) return corrupt("sample count is out of range");
  std::vector<Sample> samples(static_cast<std::size_t>(*count));
  std::vector<std::int64_t> integers(samples.size());
  for (const auto member : integer_columns) {
    if (!reader.integers(integers)) return corrupt("ends within its integers");
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i].*member = integers[i];
  }
  std::array<std::vector<std::uint64_t>, double_columns> columns;
  for (auto& column : columns) {
    column.resize(samples.size());
    if (!reader.doubles(column)) return corrupt("ends within its doubles");
  }
  if (!reader.at_end()) return corrupt("has bytes after its end");
  for (std::size_t i = 0; i < samples.size(); ++i)
    visit_doubles(samples[i], [&](std::size_t column, double& value) {
      value = std::bit_cast<double>(columns[column][i]);
    });
  return samples;
}

}  // namespace joulecast::history
