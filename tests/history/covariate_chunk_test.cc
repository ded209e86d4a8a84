#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <bit>
#include <cmath>

#include "history/chunk_codec.h"

namespace joulecast::history {
namespace {

using signals::CovariateChange;

void expect_covariate_round_trip(const std::vector<CovariateChange>& changes) {
  const auto decoded = decode_covariates(encode_covariates(changes, 1));
  ASSERT_TRUE(decoded) << describe(decoded.error());
  ASSERT_EQ(decoded->size(), changes.size());
  for (std::size_t k = 0; k < changes.size(); ++k) {
    ASSERT_EQ((*decoded)[k].utime_us, changes[k].utime_us);
    ASSERT_EQ((*decoded)[k].name, changes[k].name);
    ASSERT_EQ(std::bit_cast<std::uint64_t>((*decoded)[k].value),
              std::bit_cast<std::uint64_t>(changes[k].value));
  }
}

RC_GTEST_PROP(CovariateChunk, KeepsEveryBit, ()) {
  const auto count = *rc::gen::inRange<std::size_t>(1, 200);
  std::vector<CovariateChange> changes;
  for (std::size_t k = 0; k < count; ++k)
    changes.push_back({*rc::gen::arbitrary<std::int64_t>(), "n" + std::to_string(*rc::gen::inRange(0, 64)),
                       std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>())});
  expect_covariate_round_trip(changes);
}

TEST(CovariateChunk, StoresTheLargestChunk) {
  std::vector<CovariateChange> changes;
  for (std::size_t k = 0; k < max_chunk_changes; ++k) {
    std::string name = std::to_string(k);
    name.resize(signals::max_covariate_name_length, 'a');
    changes.push_back({static_cast<std::int64_t>(k), name + "=" + name, NAN});
  }
  expect_covariate_round_trip(changes);
}

TEST(CovariateChunk, RepeatedNamesCostLittle) {
  std::vector<CovariateChange> changes;
  for (int k = 0; k < 1024; ++k)
    changes.push_back({1'700'000'000'000'000 + 100'000 * k, "processor_load", 0.5 + 0.25 * (k % 2)});
  EXPECT_LT(encode_covariates(changes, 3).size(), 200u);
}

TEST(CovariateChunk, RejectsTruncatedAndChangedBytes) {
  const auto whole = encode_covariates(
      std::vector<CovariateChange>{{5, "load", 1.5}, {6, "floor=ice", 1}, {7, "load", NAN}}, 1);
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(decode_covariates(std::span(whole).first(size))) << size;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    auto changed = whole;
    changed[at] ^= std::byte{0x40};
    const auto decoded = decode_covariates(changed);
    if (decoded) continue;  // an unused bit of the frame
    EXPECT_EQ(decoded.error().fault, Fault::corrupt);
  }
}

RC_GTEST_PROP(CovariateChunk, AnyBytesAreRejectedOrRead, (const std::vector<std::uint8_t>& bytes)) {
  std::vector<std::byte> chunk{std::byte{1}};
  for (const std::uint8_t b : bytes) chunk.push_back(static_cast<std::byte>(b));
  (void)decode_covariates(chunk);
}

}  // namespace
}  // namespace joulecast::history
