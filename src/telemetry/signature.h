#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "telemetry/codec.h"

// Proof of a message's sender: HMAC-SHA-256 under the robot's key, as specified in signed_message_t.lcm.
namespace joulecast::telemetry {

// The bytes of the message signed for that channel; its previous `mac` is ignored.
[[nodiscard]] Result<std::vector<std::uint8_t>> sign(std::string_view channel, SignedMessage message,
                                                     std::string_view key);

// Whether the message was signed for that channel with that key.
[[nodiscard]] bool is_authentic(std::string_view channel, const SignedMessage& message, std::string_view key);

}  // namespace joulecast::telemetry
