#include "history/telemetry_chunk.h"

#include <zstd.h>

#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

namespace joulecast::history {
namespace {

using telemetry::Sample;

constexpr std::byte format{1};
constexpr std::size_t double_columns = 18;
constexpr std::size_t max_varint_bytes = 10;
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

using Bytes = std::vector<std::byte>;

void put_varint(Bytes& out, std::uint64_t value) {
  while (value >= 0x80) {
    out.push_back(static_cast<std::byte>(value | 0x80));
    value >>= 7;
  }
  out.push_back(static_cast<std::byte>(value));
}

// Wrapping arithmetic, so that any two 64-bit values have a difference.
std::uint64_t zigzag(std::uint64_t difference) {
  return (difference << 1) ^ (0 - (difference >> 63));
}
std::uint64_t unzigzag(std::uint64_t code) {
  return (code >> 1) ^ (0 - (code & 1));
}

void put_integers(Bytes& out, std::span<const Sample> samples, std::int64_t Sample::*member) {
  std::uint64_t last = 0;
  std::uint64_t last_step = 0;
  for (const Sample& sample : samples) {
    const auto value = static_cast<std::uint64_t>(sample.*member);
    const std::uint64_t step = value - last;
    put_varint(out, zigzag(step - last_step));
    last = value;
    last_step = step;
  }
}

void put_doubles(Bytes& out, std::span<const std::uint64_t> bits) {
  bool constant = true;
  for (const std::uint64_t value : bits) constant = constant && value == bits.front();
  if (constant) {
    out.push_back(std::byte{0});
    for (int k = 0; k < 8; ++k) out.push_back(static_cast<std::byte>(bits.front() >> (8 * k)));
    return;
  }
  out.push_back(std::byte{1});
  const std::size_t start = out.size();
  const std::size_t count = bits.size();
  out.resize(start + 8 * count);
  std::uint64_t last = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t changed = bits[i] ^ last;
    for (std::size_t k = 0; k < 8; ++k)
      out[start + k * count + i] = static_cast<std::byte>(changed >> (8 * k));
    last = bits[i];
  }
}

// Reads the plain bytes; once they run out, every further read fails.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : rest_(bytes) {}

  std::optional<std::uint64_t> varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      if (rest_.empty()) return std::nullopt;
      const auto byte = std::to_integer<std::uint64_t>(rest_.front());
      rest_ = rest_.subspan(1);
      value |= (byte & 0x7f) << shift;
      if ((byte & 0x80) == 0) return value;
    }
    return std::nullopt;
  }

  std::optional<std::span<const std::byte>> take(std::size_t size) {
    if (rest_.size() < size) return std::nullopt;
    const auto taken = rest_.first(size);
    rest_ = rest_.subspan(size);
    return taken;
  }

  bool at_end() const { return rest_.empty(); }

 private:
  std::span<const std::byte> rest_;
};

bool read_integers(Reader& reader, std::vector<Sample>& samples, std::int64_t Sample::*member) {
  std::uint64_t last = 0;
  std::uint64_t step = 0;
  for (Sample& sample : samples) {
    const auto code = reader.varint();
    if (!code) return false;
    step += unzigzag(*code);
    last += step;
    sample.*member = static_cast<std::int64_t>(last);
  }
  return true;
}

bool read_doubles(Reader& reader, std::span<std::uint64_t> bits) {
  const auto kind = reader.take(1);
  if (!kind) return false;
  const bool constant = kind->front() == std::byte{0};
  if (!constant && kind->front() != std::byte{1}) return false;
  const std::size_t count = constant ? 1 : bits.size();
  const auto planes = reader.take(8 * count);
  if (!planes) return false;
  std::uint64_t last = 0;
  for (std::size_t i = 0; i < bits.size(); ++i) {
    if (i < count)
      for (std::size_t k = 0; k < 8; ++k)
        last ^= std::to_integer<std::uint64_t>((*planes)[k * count + i]) << (8 * k);
    bits[i] = last;
  }
  return true;
}

struct FreeCompressor {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};
struct FreeDecompressor {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

void append_compressed(Bytes& out, const Bytes& plain, int level) {
  thread_local const std::unique_ptr<ZSTD_CCtx, FreeCompressor> context(ZSTD_createCCtx());
  if (!context) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, level);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  const std::size_t start = out.size();
  out.resize(start + ZSTD_compressBound(plain.size()));
  const std::size_t written =
      ZSTD_compress2(context.get(), out.data() + start, out.size() - start, plain.data(), plain.size());
  if (ZSTD_isError(written)) throw std::runtime_error(ZSTD_getErrorName(written));
  out.resize(start + written);
  out.shrink_to_fit();
}

tl::unexpected<Error> corrupt(std::string message) {
  return fail(Fault::corrupt, "telemetry chunk", std::move(message));
}

Result<Bytes> decompressed(std::span<const std::byte> frame) {
  thread_local const std::unique_ptr<ZSTD_DCtx, FreeDecompressor> context(ZSTD_createDCtx());
  if (!context) throw std::bad_alloc();
  const unsigned long long size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN) return corrupt("no zstd frame");
  if (size > max_plain_bytes)
    return corrupt("declares " + std::to_string(size) + " bytes, more than a chunk has");
  Bytes plain(static_cast<std::size_t>(size));
  const std::size_t read =
      ZSTD_decompressDCtx(context.get(), plain.data(), plain.size(), frame.data(), frame.size());
  if (ZSTD_isError(read)) return corrupt(ZSTD_getErrorName(read));
  if (read != plain.size()) return corrupt("shorter than declared");
  return plain;
}

}  // namespace

std::vector<std::byte> encode_chunk(std::span<const Sample> samples, int level) {
  assert(!samples.empty() && samples.size() <= max_chunk_samples);
  Bytes plain;
  plain.reserve(samples.size() * (8 * double_columns + 4) + 16);
  put_varint(plain, samples.size());
  put_integers(plain, samples, &Sample::utime_us);
  put_integers(plain, samples, &Sample::sequence);
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
  auto plain = decompressed(bytes.subspan(1));
  if (!plain) return tl::unexpected(plain.error());
  Reader reader(*plain);
  const auto count = reader.varint();
  if (!count || *count == 0 || *count > max_chunk_samples) return corrupt("sample count is out of range");
  std::vector<Sample> samples(static_cast<std::size_t>(*count));
  if (!read_integers(reader, samples, &Sample::utime_us) ||
      !read_integers(reader, samples, &Sample::sequence))
    return corrupt("ends within its integers");
  std::array<std::vector<std::uint64_t>, double_columns> columns;
  for (auto& column : columns) {
    column.resize(samples.size());
    if (!read_doubles(reader, column)) return corrupt("ends within its doubles");
  }
  if (!reader.at_end()) return corrupt("has bytes after its end");
  for (std::size_t i = 0; i < samples.size(); ++i)
    visit_doubles(samples[i], [&](std::size_t column, double& value) {
      value = std::bit_cast<double>(columns[column][i]);
    });
  return samples;
}

}  // namespace joulecast::history
