#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "access/sha256.h"
#include "samples.h"
#include "telemetry/codec.h"

namespace joulecast::telemetry {
namespace {

const std::string key(32, 'k');
constexpr const char* signed_channel = "ROBOT_TELEMETRY.nomad";

std::vector<std::uint8_t> content() {
  signals::Sample sample;
  sample.utime_us = 1'700'000'000'000'000;
  return encode_telemetry("nomad", sample).value();
}

TEST(Signature, CoversChannelKeyAndContent) {
  const auto inside = content();
  const auto bytes = sign(signed_channel, {123, 456, inside, {}}, key).value();
  ASSERT_TRUE(is_signed(bytes));
  ASSERT_FALSE(is_signed(inside));
  const auto message = decode_signed(bytes);
  ASSERT_TRUE(message) << describe(message.error());
  EXPECT_EQ(message->utime_us, 123);
  EXPECT_EQ(message->sequence, 456);
  EXPECT_TRUE(std::ranges::equal(message->content, inside));
  EXPECT_TRUE(is_authentic(signed_channel, *message, key));
  EXPECT_FALSE(is_authentic("ROBOT_TELEMETRY.other", *message, key));
  EXPECT_FALSE(is_authentic(signed_channel, *message, std::string(32, 'l')));
  for (std::size_t k = 8; k < bytes.size(); ++k) {
    std::vector<std::uint8_t> changed = bytes;
    changed[k] ^= 1;
    const auto forged = decode_signed(changed);
    EXPECT_TRUE(!forged || !is_authentic(signed_channel, *forged, key)) << "byte " << k;
  }
}

// The signed text, assembled independently of the code under test.
TEST(Signature, MatchesDocumentedText) {
  const auto inside = content();
  const auto message = decode_signed(sign(signed_channel, {0x0102, -2, inside, {}}, key).value());
  std::string text(signed_channel);
  text.push_back('\0');
  text.append("\0\0\0\0\0\0\x01\x02", 8).append("\xff\xff\xff\xff\xff\xff\xff\xfe", 8);
  text.append(inside.begin(), inside.end());
  EXPECT_EQ(message->mac, access::hmac_sha256(key, text));
}

TEST(Signature, DecodesSignedContent) {
  const auto bytes = sign(signed_channel, {1, 2, content(), {}}, key).value();
  const auto decoded = decode_telemetry(bytes);
  ASSERT_TRUE(decoded) << describe(decoded.error());
  EXPECT_EQ(decoded->robot_id, "nomad");
  EXPECT_EQ(decoded->sample.utime_us, 1'700'000'000'000'000);
  // A nested signed message is not decoded.
  EXPECT_FALSE(decode_telemetry(sign(signed_channel, {1, 3, bytes, {}}, key).value()));
}

TEST(Signature, RejectsTruncatedMessages) {
  const auto bytes = sign(signed_channel, {1, 2, content(), {}}, key).value();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode_signed(std::span(bytes).first(size))) << size;
    EXPECT_FALSE(decode_telemetry(std::span(bytes).first(size))) << size;
  }
}

}  // namespace
}  // namespace joulecast::telemetry
