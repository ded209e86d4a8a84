#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/error.h"
#include "signals/sample.h"

// Raw samples as a compressed block, bit-exact (NaN payloads included).
//
// Layout: one byte of format (1), then one zstd frame with checksum of
//   sample count, varint;
//   utime and sequence, each as zigzag varints of the difference of differences (both start from 0);
//   each of the double columns in the order of `visit_fields`: a byte 0 and its 8 bytes when all its
//   values have the same bits, else a byte 1 and eight planes of `count` bytes, least significant first, of
//   every value's bits XORed with those of the value before it.
// Integers are little-endian.
namespace joulecast::history {

inline constexpr std::size_t max_chunk_samples = 65'536;

// 1 to max_chunk_samples samples. `level`: zstd's, 1 is fast.
std::vector<std::byte> encode_chunk(std::span<const signals::Sample> samples, int level);

// Fault::corrupt for bytes that are no whole chunk; safe on any bytes.
Result<std::vector<signals::Sample>> decode_chunk(std::span<const std::byte> bytes);

}  // namespace joulecast::history
