#include "history/telemetry_chunk.h"

#include <array>
#include <bit>
#include <cassert>
#include <cstdint>

#include "base/try.h"
#include "history/chunk_bytes.h"

namespace joulecast::history {
namespace {

using signals::Sample;

constexpr std::byte sample_chunk_format{1};
constexpr std::size_t double_columns = signals::sample_numbers;
// No sample takes more than two varints and its doubles; the columns' first bytes and the count come on top.
constexpr std::size_t max_sample_bytes =
    max_chunk_samples * (2 * max_varint_bytes + 8 * double_columns) + double_columns * 9 + max_varint_bytes;

constexpr std::array integer_columns{&Sample::utime_us, &Sample::sequence};

tl::unexpected<Error> corrupt_samples(std::string message) {
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
  for (const Sample& sample : samples) {
    auto* column = columns.data();
    signals::visit_fields(sample, [&](const signals::SampleField&, double value) {
      column++->push_back(std::bit_cast<std::uint64_t>(value));
    });
  }
  for (const auto& column : columns) put_doubles(plain, column);
  Bytes out{sample_chunk_format};
  append_compressed(out, plain, level);
  return out;
}

Result<std::vector<Sample>> decode_chunk(std::span<const std::byte> bytes) {
  if (bytes.empty() || bytes.front() != sample_chunk_format) return corrupt_samples("unknown format");
  TRY_ASSIGN(auto plain, decompressed(bytes.subspan(1), max_sample_bytes, "telemetry chunk"));
  ByteReader reader(plain);
  const auto count = reader.varint();
  if (!count || *count == 0 || *count > max_chunk_samples)
    return corrupt_samples("sample count is out of range");
  std::vector<Sample> samples(static_cast<std::size_t>(*count));
  std::vector<std::int64_t> integers(samples.size());
  for (const auto member : integer_columns) {
    if (!reader.integers(integers)) return corrupt_samples("ends within its integers");
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i].*member = integers[i];
  }
  std::array<std::vector<std::uint64_t>, double_columns> columns;
  for (auto& column : columns) {
    column.resize(samples.size());
    if (!reader.doubles(column)) return corrupt_samples("ends within its doubles");
  }
  if (!reader.at_end()) return corrupt_samples("has bytes after its end");
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto* column = columns.data();
    signals::visit_fields(samples[i], [&](const signals::SampleField&, double& value) {
      value = std::bit_cast<double>((*column++)[i]);
    });
  }
  return samples;
}

}  // namespace joulecast::history
