#include "history/chunk_bytes.h"

#include <zstd.h>

#include <algorithm>
#include <memory>
#include <new>
#include <stdexcept>

namespace joulecast::history {
namespace {

std::uint64_t zigzag(std::uint64_t difference) {
  return (difference << 1) ^ (0 - (difference >> 63));
}
std::uint64_t unzigzag(std::uint64_t code) {
  return (code >> 1) ^ (0 - (code & 1));
}

struct FreeCompressor {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};
struct FreeDecompressor {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

}  // namespace

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

std::optional<std::uint64_t> ByteReader::varint() {
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

std::optional<std::span<const std::byte>> ByteReader::take(std::size_t size) {
  if (rest_.size() < size) return std::nullopt;
  const auto taken = rest_.first(size);
  rest_ = rest_.subspan(size);
  return taken;
}

bool ByteReader::integers(std::span<std::int64_t> values) {
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

bool ByteReader::doubles(std::span<std::uint64_t> bits) {
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

Result<Bytes> decompressed(std::span<const std::byte> frame, std::size_t max_bytes, const char* what) {
  thread_local const std::unique_ptr<ZSTD_DCtx, FreeDecompressor> context(ZSTD_createDCtx());
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

}  // namespace joulecast::history
