#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/error.h"
#include "signals/covariates.h"
#include "signals/sample.h"

// The format of chunks of telemetry and covariates: little-endian numbers in one zstd frame with checksum.
namespace joulecast::history {

using Bytes = std::vector<std::byte>;

// Appends one zstd frame. `level`: zstd's, 1 is fast.
void append_compressed(Bytes& out, const Bytes& plain, int level);

// The content of one zstd frame; Fault::corrupt on `what` for anything else, and for more than `max_bytes`.
Result<Bytes> decompressed(std::span<const std::byte> frame, std::size_t max_bytes, const char* what);

// Raw samples as a compressed block, bit-exact (NaN payloads included).
//
// Layout: one byte of format (1), then one zstd frame with checksum of
//   sample count, varint;
//   utime and sequence, each as zigzag varints of the difference of differences (both start from 0);
//   each of the double columns in the order of `visit_fields`: a byte 0 and its 8 bytes when all its
//   values have the same bits, else a byte 1 and eight planes of `count` bytes, least significant first, of
//   every value's bits XORed with those of the value before it.
// Integers are little-endian.
inline constexpr std::size_t max_chunk_samples = 65'536;

// 1 to max_chunk_samples samples. `level`: zstd's, 1 is fast.
std::vector<std::byte> encode_chunk(std::span<const signals::Sample> samples, int level);

// Fault::corrupt for bytes that are no whole chunk; safe on any bytes.
Result<std::vector<signals::Sample>> decode_chunk(std::span<const std::byte> bytes);

// Changes of covariates as a compressed block, bit-exact.
//
// Layout: one byte of format (1), then one zstd frame with checksum of
//   number of names, varint; each name as its length, varint, and its bytes;
//   number of changes, varint;
//   times as those of samples, each change's name as a varint into the names, values as a column of samples
inline constexpr std::size_t max_chunk_changes = 65'536;

// 1 to max_chunk_changes changes of names no longer than covariates may have. `level`: zstd's, 1 is fast.
std::vector<std::byte> encode_covariates(std::span<const signals::CovariateChange> changes, int level);

// Fault::corrupt for bytes that are no whole chunk; safe on any bytes.
Result<std::vector<signals::CovariateChange>> decode_covariates(std::span<const std::byte> bytes);

}  // namespace joulecast::history
