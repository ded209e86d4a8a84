#include <span>

#include "fuzz.h"
#include "history/chunk_codec.h"

using namespace joulecast;

// The input is read as samples, which must round-trip, and as a chunk, which is usually invalid.
JOULECAST_FUZZ_TARGET(chunk) {
  const auto bytes = std::as_bytes(std::span(data, size));
  (void)history::decode_chunk(bytes);
  (void)history::decode_covariates(bytes);
  std::vector<signals::Sample> samples(1 + size / 64);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    samples[k].utime_us = static_cast<std::int64_t>(k) * (size > 0 ? data[k % size] : 1);
    samples[k].sequence = size > 1 ? data[(3 * k + 1) % size] : 0;
    samples[k].battery_voltage_v = size > 2 ? data[(5 * k + 2) % size] : 0;
  }
  std::vector<std::byte> chunk = history::encode_chunk(samples, 1);
  const auto again = history::decode_chunk(chunk);
  testing::require(again && again->size() == samples.size());
  for (std::size_t k = 0; k < samples.size(); ++k)
    testing::require((*again)[k].utime_us == samples[k].utime_us &&
                     (*again)[k].sequence == samples[k].sequence &&
                     (*again)[k].battery_voltage_v == samples[k].battery_voltage_v);
  for (std::size_t k = 0; k < size; ++k) chunk[(k * 7919 + data[k]) % chunk.size()] ^= std::byte{data[k]};
  (void)history::decode_chunk(chunk);
}
