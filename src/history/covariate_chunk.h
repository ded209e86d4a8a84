#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/error.h"
#include "signals/covariates.h"

// Changes of covariates as a compressed block, bit-exact.
//
// Layout: one byte of format (1), then one zstd frame with checksum of
//   number of names, varint; each name as its length, varint, and its bytes;
//   number of changes, varint;
//   times as put_integers(), each change's name as a varint into the names, values as put_doubles()
//   (chunk_bytes.h).
namespace joulecast::history {

inline constexpr std::size_t max_chunk_changes = 65'536;

// 1 to max_chunk_changes changes of names no longer than covariates may have. `level`: zstd's, 1 is fast.
std::vector<std::byte> encode_covariates(std::span<const signals::CovariateChange> changes, int level);

// Fault::corrupt for bytes that are no whole chunk; safe on any bytes.
Result<std::vector<signals::CovariateChange>> decode_covariates(std::span<const std::byte> bytes);

}  // namespace joulecast::history
