#include "ingest/signature_gate.h"

#include <fmt/format.h>

#include "telemetry/codec.h"

namespace joulecast::ingest {

bool SignatureGate::Window::take(std::int64_t sequence) {
  constexpr std::uint64_t width = 64;
  if (highest_ == INT64_MIN || sequence > highest_) {
    const std::uint64_t by = static_cast<std::uint64_t>(sequence) - static_cast<std::uint64_t>(highest_);
    taken_ = (by < width ? taken_ << by : 0) | 1;
    highest_ = sequence;
    return true;
  }
  const std::uint64_t back = static_cast<std::uint64_t>(highest_) - static_cast<std::uint64_t>(sequence);
  if (back >= width || (taken_ >> back & 1) != 0) return false;
  taken_ |= std::uint64_t{1} << back;
  return true;
}

Result<void> SignatureGate::read_keys() {
  looked_ = std::chrono::steady_clock::now();
  if (options_.key_file.empty()) {
    if (options_.required) return invalid("ingest.require_signed", "needs an ingest.key_file");
    return {};
  }
  stamp_ = access::stamp_of(options_.key_file);
  Result<access::RobotKeys> keys = access::read_robot_keys(options_.key_file);
  if (!keys) return fail(keys.error().fault, "ingest.key_file", describe(keys.error()));
  keys_ = std::move(*keys);
  return {};
}

std::optional<Result<void>> SignatureGate::refresh() {
  if (options_.key_file.empty()) return std::nullopt;
  const auto now = std::chrono::steady_clock::now();
  if (now - looked_ < std::chrono::seconds(1)) return std::nullopt;
  looked_ = now;
  if (access::stamp_of(options_.key_file) == stamp_) return std::nullopt;
  return read_keys();
}

std::optional<RefusedMessage> SignatureGate::check(std::string_view channel, std::string_view robot_id,
                                                   std::span<const std::uint8_t> bytes,
                                                   std::int64_t host_utime_us) {
  const auto refused = [&](IngestFault fault, std::string why) {
    return RefusedMessage{fault, fmt::format("{}: {}", channel, why)};
  };
  const auto key = keys_.find(robot_id);
  const bool has_key = key != keys_.end();
  if (!telemetry::is_signed(bytes)) {
    if (has_key) return refused(IngestFault::unsigned_message, "is not signed; the robot has a key");
    if (options_.required) return refused(IngestFault::unsigned_message, "is not signed");
    return std::nullopt;
  }
  if (!has_key && !options_.required) return std::nullopt;
  const auto message = telemetry::decode_signed(bytes);
  if (!message) return refused(IngestFault::undecodable, describe(message.error()));
  if (!has_key) return refused(IngestFault::bad_signature, "is signed; the robot has no key here");
  if (!telemetry::is_authentic(channel, *message, key->second))
    return refused(IngestFault::bad_signature, "the signature is not that of the robot's key");
  const double age_s = 1e-6 * (static_cast<double>(host_utime_us) - static_cast<double>(message->utime_us));
  if (std::abs(age_s) > 1e-6 * static_cast<double>(options_.max_age_us))
    return refused(IngestFault::replayed, fmt::format("was signed {:.1f} s before the host's time", age_s));
  auto window = windows_.find(channel);
  // Messages of a key that is no longer in force exclude none of its successor's.
  if (window == windows_.end() || window->second.first != key->second)
    window = windows_.insert_or_assign(std::string(channel), std::pair(key->second, Window())).first;
  if (!window->second.second.take(message->sequence))
    return refused(IngestFault::replayed, fmt::format("the sequence {} came before", message->sequence));
  return std::nullopt;
}

}  // namespace joulecast::ingest
