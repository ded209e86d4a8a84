#include "history/chunk_codec.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/try.h"

namespace joulecast::history {
namespace {

constexpr std::size_t max_varint_bytes = 10;

std::uint64_t zigzag(std::uint64_t difference) {
  return (difference << 1) ^ (0 - (difference >> 63));
}
std::uint64_t unzigzag(std::uint64_t code) {
  return (code >> 1) ^ (0 - (code & 1));
}

void put_varint(Bytes& out, std::uint64_t value) {
  while (value >= 0x80) {
    out.push_back(static_cast<std::byte>(value | 0x80));
    value >>= 7;
  }
  out.push_back(static_cast<std::byte>(value));
}

void put_integers(Bytes& out, std::span<const std::int64_t> values) {
  std::uint64_t last = 0;
  std::uint64_t last_step = 0;
  for (const std::int64_t signed_value : values) {
    const auto value = static_cast<std::uint64_t>(signed_value);
    const std::uint64_t step = value - last;
    put_varint(out, zigzag(step - last_step));
    last = value;
    last_step = step;
  }
}

void put_doubles(Bytes& out, std::span<const std::uint64_t> bits) {
  if (std::ranges::count(bits, bits.front()) == std::ssize(bits)) {
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

// Reads plain bytes; once they run out, every further read fails.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}

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

  // As many as the span holds, as put_integers() and put_doubles() wrote them.
  bool integers(std::span<std::int64_t> values) {
    std::uint64_t last = 0;
    std::uint64_t step = 0;
    for (std::int64_t& value : values) {
      const auto code = varint();
      if (!code) return false;
      step += unzigzag(*code);
      last += step;
      value = static_cast<std::int64_t>(last);
    }
    return true;
  }

  bool doubles(std::span<std::uint64_t> bits) {
    const auto kind = take(1);
    if (!kind) return false;
    const bool constant = kind->front() == std::byte{0};
    if (!constant && kind->front() != std::byte{1}) return false;
    const std::size_t count = constant ? 1 : bits.size();
    const auto planes = take(8 * count);
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

  bool at_end() const { return rest_.empty(); }

 private:
  std::span<const std::byte> rest_;
};

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

using signals::CovariateChange;

constexpr std::byte covariate_chunk_format{1};
constexpr std::size_t max_name_bytes = 2 * signals::max_covariate_name_length + 1;
// Every change may have a name of its own.
constexpr std::size_t max_covariate_bytes =
    max_chunk_changes * (3 * max_varint_bytes + max_name_bytes + 8) + 2 * max_varint_bytes + 9;

tl::unexpected<Error> corrupt_covariates(std::string message) {
  return fail(Fault::corrupt, "covariate chunk", std::move(message));
}

}  // namespace

void append_compressed(Bytes& out, const Bytes& plain, int level) {
  thread_local const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                                  ZSTD_freeCCtx);
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

Result<Bytes> decompressed(std::span<const std::byte> frame, std::size_t max_bytes, const char* what) {
  thread_local const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(),
                                                                                  ZSTD_freeDCtx);
  if (!context) throw std::bad_alloc();
  const unsigned long long size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN)
    return fail(Fault::corrupt, what, "no zstd frame");
  if (size > max_bytes)
    return fail(Fault::corrupt, what, "declares " + std::to_string(size) + " bytes, more than a chunk has");
  Bytes plain(static_cast<std::size_t>(size));
  const std::size_t read =
      ZSTD_decompressDCtx(context.get(), plain.data(), plain.size(), frame.data(), frame.size());
  if (ZSTD_isError(read)) return fail(Fault::corrupt, what, ZSTD_getErrorName(read));
  if (read != plain.size()) return fail(Fault::corrupt, what, "shorter than declared");
  return plain;
}

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

std::vector<std::byte> encode_covariates(std::span<const CovariateChange> changes, int level) {
  assert(!changes.empty() && changes.size() <= max_chunk_changes);
  std::map<std::string_view, std::size_t> place;
  std::vector<std::int64_t> times;
  std::vector<std::uint64_t> values;
  Bytes of_names, places;
  for (const CovariateChange& change : changes) {
    const auto [entry, is_new] = place.emplace(change.name, place.size());
    if (is_new) {
      put_varint(of_names, change.name.size());
      for (const char c : change.name) of_names.push_back(static_cast<std::byte>(c));
    }
    times.push_back(change.utime_us);
    put_varint(places, entry->second);
    values.push_back(std::bit_cast<std::uint64_t>(change.value));
  }
  Bytes plain;
  put_varint(plain, place.size());
  plain.insert(plain.end(), of_names.begin(), of_names.end());
  put_varint(plain, changes.size());
  put_integers(plain, times);
  plain.insert(plain.end(), places.begin(), places.end());
  put_doubles(plain, values);
  Bytes out{covariate_chunk_format};
  append_compressed(out, plain, level);
  return out;
}

Result<std::vector<CovariateChange>> decode_covariates(std::span<const std::byte> bytes) {
  if (bytes.empty() || bytes.front() != covariate_chunk_format) return corrupt_covariates("unknown format");
  TRY_ASSIGN(const auto plain, decompressed(bytes.subspan(1), max_covariate_bytes, "covariate chunk"));
  ByteReader reader(plain);
  const auto name_count = reader.varint();
  if (!name_count || *name_count == 0 || *name_count > max_chunk_changes)
    return corrupt_covariates("number of names is out of range");
  std::vector<std::string> names;
  for (std::uint64_t k = 0; k < *name_count; ++k) {
    const auto length = reader.varint();
    if (!length || *length > max_name_bytes) return corrupt_covariates("length of a name is out of range");
    const auto text = reader.take(static_cast<std::size_t>(*length));
    if (!text) return corrupt_covariates("ends within a name");
    names.emplace_back(reinterpret_cast<const char*>(text->data()), text->size());
  }
  const auto count = reader.varint();
  if (!count || *count == 0 || *count > max_chunk_changes)
    return corrupt_covariates("number of changes is out of range");
  std::vector<std::int64_t> times(static_cast<std::size_t>(*count));
  if (!reader.integers(times)) return corrupt_covariates("ends within its times");
  std::vector<CovariateChange> changes(times.size());
  for (std::size_t k = 0; k < changes.size(); ++k) {
    const auto place = reader.varint();
    if (!place || *place >= names.size()) return corrupt_covariates("a change has no name");
    changes[k].utime_us = times[k];
    changes[k].name = names[static_cast<std::size_t>(*place)];
  }
  std::vector<std::uint64_t> values(changes.size());
  if (!reader.doubles(values)) return corrupt_covariates("ends within its values");
  if (!reader.at_end()) return corrupt_covariates("has bytes after its end");
  for (std::size_t k = 0; k < changes.size(); ++k) changes[k].value = std::bit_cast<double>(values[k]);
  return changes;
}

}  // namespace joulecast::history
