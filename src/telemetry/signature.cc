#include "telemetry/signature.h"

#include <array>
#include <string>

#include "access/sha256.h"

namespace joulecast::telemetry {
namespace {

std::array<std::uint8_t, 32> mac_of(std::string_view channel, const SignedMessage& message,
                                    std::string_view key) {
  std::string text;
  text.reserve(channel.size() + 17 + message.content.size());
  text.append(channel).push_back('\0');
  for (const std::int64_t number : {message.utime_us, message.sequence})
    for (int shift = 56; shift >= 0; shift -= 8)
      text.push_back(static_cast<char>(static_cast<std::uint64_t>(number) >> shift & 0xff));
  text.append(reinterpret_cast<const char*>(message.content.data()), message.content.size());
  return access::hmac_sha256(key, text);
}

std::string_view text_of(const std::array<std::uint8_t, 32>& mac) {
  return {reinterpret_cast<const char*>(mac.data()), mac.size()};
}

}  // namespace

Result<std::vector<std::uint8_t>> sign(std::string_view channel, SignedMessage message,
                                       std::string_view key) {
  message.mac = mac_of(channel, message, key);
  return encode_signed(message);
}

bool is_authentic(std::string_view channel, const SignedMessage& message, std::string_view key) {
  return access::equal_in_constant_time(text_of(mac_of(channel, message, key)), text_of(message.mac));
}

}  // namespace joulecast::telemetry
