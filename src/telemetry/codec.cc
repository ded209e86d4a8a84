#include "telemetry/codec.h"

#include <algorithm>
#include <bit>
#include <boost/endian/conversion.hpp>
#include <iterator>
#include <joulecast/energy_state_t.hpp>
#include <joulecast/mission_event_t.hpp>
#include <joulecast/robot_covariates_t.hpp>
#include <joulecast/robot_telemetry_t.hpp>
#include <joulecast/signed_message_t.hpp>
#include <utility>

#include "access/sha256.h"
#include "base/text.h"
#include "base/try.h"
#include "telemetry/datagram.h"

namespace joulecast::telemetry {
namespace {

// In the order of Subject.
constexpr std::string_view prefixes[] = {"ROBOT_TELEMETRY.", "MISSION_EVENT.", "ROBOT_COVARIATES.",
                                         "ENERGY_STATE."};

std::string_view prefix_of(Subject subject) noexcept {
  return prefixes[static_cast<std::size_t>(subject)];
}

enum class Text { id, optional_id, note, covariate_name };

// The fault of a string of the contract; empty if it is valid.
std::string fault_of(std::string_view text, Text kind, std::size_t max_length) {
  if (text.size() > max_length)
    return "is " + std::to_string(text.size()) + " bytes long; at most " + std::to_string(max_length) +
           " are allowed";
  if (kind == Text::note) {
    if (text.find('\0') != std::string_view::npos) return "contains a NUL byte";
    return is_utf8(text) ? "" : "is not UTF-8";
  }
  if (text.empty()) return kind == Text::optional_id ? "" : "is empty";
  if (kind == Text::covariate_name)
    return signals::is_valid_covariate_name(text)
               ? ""
               : "must be 1 to " + std::to_string(signals::max_covariate_name_length) +
                     " of letters, digits, '.', '_' and '-', which '=' and as many more may follow";
  // Robot ids are such ids, too, but shorter.
  return signals::is_valid_mission_id(text) ? "" : "may contain only letters, digits, '.', '_' and '-'";
}

// Walks the declared layout of a message over its bytes without reading a value it has not checked to be
// there. The first fault sticks; later steps do nothing.
class Guard {
 public:
  Guard(std::span<const std::uint8_t> bytes, std::int64_t fingerprint) : bytes_(bytes) {
    if (bytes.size() > max_message_bytes) {
      refuse("", "message of " + std::to_string(bytes.size()) + " bytes; at most " +
                     std::to_string(max_message_bytes) + " are accepted");
      return;
    }
    const std::uint8_t* at = take(8, "fingerprint");
    if (at != nullptr && boost::endian::load_big_s64(at) != fingerprint)
      refuse("fingerprint", "is not that of the type: another type or another version of it");
  }

  void fixed(std::size_t size, const char* field) { take(size, field); }

  void text(const char* field, Text kind, std::size_t max_length) {
    const std::uint8_t* head = take(4, field);
    if (head == nullptr) return;
    const std::uint64_t declared = boost::endian::load_big_u32(head);  // includes the terminating NUL
    const std::size_t left = bytes_.size() - position_;
    if (declared < 1 || declared > left) {
      refuse(field, "declares a length of " + std::to_string(declared) + " bytes where 1 to " +
                        std::to_string(left) + " can follow");
      return;
    }
    const std::uint8_t* body = take(static_cast<std::size_t>(declared), field);
    if (body[declared - 1] != 0) {
      refuse(field, "is not NUL-terminated");
      return;
    }
    const std::string_view content(reinterpret_cast<const char*>(body),
                                   static_cast<std::size_t>(declared) - 1);
    if (std::string fault = fault_of(content, kind, max_length); !fault.empty())
      refuse(field, std::move(fault));
  }

  // An int32 of at least 0 and at most `most`; 0 where it is not that.
  std::size_t count(const char* field, std::size_t most) {
    const std::uint8_t* at = take(4, field);
    if (at == nullptr) return 0;
    const std::int32_t value = boost::endian::load_big_s32(at);
    if (value >= 0 && static_cast<std::size_t>(value) <= most) return static_cast<std::size_t>(value);
    refuse(field, "is " + std::to_string(value) + "; 0 to " + std::to_string(most) + " are allowed");
    return 0;
  }

  // `count` strings in a row; a fault names the one that it is in.
  void texts(const char* field, std::size_t count, Text kind, std::size_t max_length) {
    for (std::size_t k = 0; k < count && !error_; ++k) {
      text(field, kind, max_length);
      if (error_) error_->field.append("[").append(std::to_string(k)).append("]");
    }
  }

  void one_of(const char* field, std::int8_t low, std::int8_t high) {
    const std::uint8_t* at = take(1, field);
    if (at == nullptr) return;
    const auto value = static_cast<std::int8_t>(*at);
    if (value < low || value > high) refuse(field, "has the unknown value " + std::to_string(value));
  }

  Result<void> finish() {
    if (!error_ && position_ != bytes_.size())
      refuse("", std::to_string(bytes_.size() - position_) + " bytes follow the message");
    if (error_) return tl::unexpected(std::move(*error_));
    return {};
  }

 private:
  const std::uint8_t* take(std::size_t size, const char* field) {
    if (error_) return nullptr;
    if (bytes_.size() - position_ < size) {
      refuse(field,
             "message ends " + std::to_string(size - (bytes_.size() - position_)) + " bytes too early");
      return nullptr;
    }
    const std::uint8_t* at = bytes_.data() + position_;
    position_ += size;
    return at;
  }

  void refuse(const char* field, std::string message) {
    if (!error_) error_ = Error{Fault::corrupt, field, std::move(message)};
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t position_ = 0;
  std::optional<Error> error_;
};

// The content of a signed message; other bytes unchanged, also of a damaged one, which the guard refuses.
std::span<const std::uint8_t> content_of(std::span<const std::uint8_t> bytes) {
  if (!is_signed(bytes)) return bytes;
  const auto message = decode_signed(bytes);
  return message ? message->content : bytes;
}

template <class Message>
Result<Message> decode_guarded(std::span<const std::uint8_t> bytes, Guard& guard) {
  TRY(guard.finish());
  Message message;
  const int size = static_cast<int>(bytes.size());
  if (message.decode(bytes.data(), 0, size) != size)
    return fail(Fault::internal, "", "the generated decoder refused a message that the guard passed");
  return message;
}

template <class Message>
Result<std::vector<std::uint8_t>> encode(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  const int size = static_cast<int>(bytes.size());
  if (message.encode(bytes.data(), 0, size) != size)
    return fail(Fault::internal, "", "the generated encoder wrote another size than it announced");
  return bytes;
}

Result<void> check_text(const std::string& field, std::string_view text, Text kind, std::size_t max_length) {
  std::string fault = fault_of(text, kind, max_length);
  if (fault.empty()) return {};
  return invalid(field, std::move(fault));
}

// Visits the common fields of energy_state_t and EnergyState: visit(of the message, of the state).
template <class Message, class State, class Visit>
void visit_energy_state(Message& m, State& s, Visit visit) {
  visit(m.utime, s.utime_us);
  visit(m.robot_id, s.robot_id);
  visit(m.mission_id, s.mission_id);
  visit(m.model_version, s.model_version);
  visit(m.measured_power, s.measured_power_w);
  visit(m.modelled_power, s.modelled_power_w);
  visit(m.measured_energy, s.measured_energy_j);
  visit(m.modelled_energy, s.modelled_energy_j);
  visit(m.unexplained_energy, s.unexplained_energy_j);
  visit(m.recovered_energy, s.recovered_energy_j);
  visit(m.state_of_charge, s.state_of_charge);
  visit(m.state_of_charge_sd, s.state_of_charge_sd);
  visit(m.range, s.range_m);
  visit(m.run_time, s.run_time_s);
  for (std::size_t k : {0u, 1u}) {
    visit(m.range_band[k], s.range_band_m[k]);
    visit(m.run_time_band[k], s.run_time_band_s[k]);
    visit(m.winding_temperature[k], s.winding_temperature_c[k]);
  }
}

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

constexpr std::size_t real = sizeof(double);
constexpr std::size_t max_covariate_text = 2 * signals::max_covariate_name_length + 1;  // name, '=', label

}  // namespace

std::string channel_of(Subject subject, std::string_view robot_id) {
  return std::string(prefix_of(subject)).append(robot_id);
}

std::optional<ChannelName> parse_channel(std::string_view channel) noexcept {
  for (std::size_t k = 0; k < std::size(prefixes); ++k) {
    if (!channel.starts_with(prefixes[k])) continue;
    const std::string_view robot_id = channel.substr(prefixes[k].size());
    if (!signals::is_valid_robot_id(robot_id)) return std::nullopt;
    return ChannelName{static_cast<Subject>(k), robot_id};
  }
  return std::nullopt;
}

std::string channel_pattern(Subject subject) {
  std::string pattern(prefix_of(subject));
  return pattern.insert(pattern.size() - 1, "\\") +
         ".+";  // of the prefix only the last character, a '.', is special
}

bool is_signed(std::span<const std::uint8_t> bytes) {
  static const std::int64_t fingerprint = signed_message_t::getHash();
  return bytes.size() >= 8 && boost::endian::load_big_s64(bytes.data()) == fingerprint;
}

Result<SignedMessage> decode_signed(std::span<const std::uint8_t> bytes) {
  static const std::int64_t fingerprint = signed_message_t::getHash();
  constexpr std::size_t head = 8 + 8 + 8 + 4;
  SignedMessage message;
  Guard guard(bytes, fingerprint);
  guard.fixed(8, "utime");
  guard.fixed(8, "sequence");
  const std::size_t size = guard.count("size", max_message_bytes);
  guard.fixed(size, "content");
  guard.fixed(message.mac.size(), "mac");
  TRY(guard.finish());
  message.utime_us = boost::endian::load_big_s64(bytes.data() + 8);
  message.sequence = boost::endian::load_big_s64(bytes.data() + 16);
  message.content = bytes.subspan(head, size);
  std::ranges::copy(bytes.subspan(head + size), message.mac.begin());
  return message;
}

Result<std::vector<std::uint8_t>> encode_signed(const SignedMessage& message) {
  signed_message_t out;
  out.utime = message.utime_us;
  out.sequence = message.sequence;
  out.size = static_cast<std::int32_t>(message.content.size());
  out.content.assign(message.content.begin(), message.content.end());
  std::ranges::copy(message.mac, out.mac);
  return encode(out);
}

Result<std::vector<std::uint8_t>> sign(std::string_view channel, SignedMessage message,
                                       std::string_view key) {
  message.mac = mac_of(channel, message, key);
  return encode_signed(message);
}

bool is_authentic(std::string_view channel, const SignedMessage& message, std::string_view key) {
  return access::equal_in_constant_time(text_of(mac_of(channel, message, key)), text_of(message.mac));
}

Result<DecodedTelemetry> decode_telemetry(std::span<const std::uint8_t> bytes) {
  bytes = content_of(bytes);
  static const std::int64_t fingerprint = robot_telemetry_t::getHash();
  Guard guard(bytes, fingerprint);
  guard.fixed(8, "utime");
  guard.fixed(8, "sequence");
  guard.text("robot_id", Text::id, signals::max_robot_id_length);
  guard.fixed(signals::sample_numbers * real, "wheel_velocity to payload_mass");
  TRY(guard.finish());

  const std::uint8_t* at = bytes.data() + 8;  // past the fingerprint
  DecodedTelemetry result;
  result.sample.utime_us = boost::endian::load_big_s64(at);
  result.sample.sequence = boost::endian::load_big_s64(at + 8);
  const std::size_t length = boost::endian::load_big_u32(at + 16);  // with its NUL
  result.robot_id.assign(reinterpret_cast<const char*>(at + 20), length - 1);
  at += 20 + length;
  signals::visit_fields(result.sample, [&](const signals::SampleField&, double& number) {
    number = std::bit_cast<double>(boost::endian::load_big_u64(at));
    at += real;
  });
  return result;
}

Result<DecodedMissionEvent> decode_mission_event(std::span<const std::uint8_t> bytes) {
  bytes = content_of(bytes);
  static const std::int64_t fingerprint = mission_event_t::getHash();
  Guard guard(bytes, fingerprint);
  guard.fixed(8, "utime");
  guard.text("robot_id", Text::id, signals::max_robot_id_length);
  guard.text("mission_id", Text::id, signals::max_mission_id_length);
  guard.one_of("event", mission_event_t::STARTED, mission_event_t::ABORTED);
  guard.fixed(real, "payload_mass");
  guard.text("note", Text::note, signals::max_note_length);
  TRY_ASSIGN(auto decoded, decode_guarded<mission_event_t>(bytes, guard));

  DecodedMissionEvent result;
  result.robot_id = std::move(decoded.robot_id);
  result.event.utime_us = decoded.utime;
  result.event.mission_id = std::move(decoded.mission_id);
  result.event.phase = static_cast<signals::MissionPhase>(decoded.event);
  result.event.payload_kg = decoded.payload_mass;
  result.event.note = std::move(decoded.note);
  return result;
}

Result<DecodedCovariates> decode_covariates(std::span<const std::uint8_t> bytes) {
  bytes = content_of(bytes);
  static const std::int64_t fingerprint = robot_covariates_t::getHash();
  Guard guard(bytes, fingerprint);
  guard.fixed(8, "utime");
  guard.text("robot_id", Text::id, max_covariates_robot_id_length);
  const std::size_t count = guard.count("n", signals::max_covariates);
  guard.texts("name", count, Text::covariate_name, max_covariate_text);
  guard.fixed(count * real, "value");
  TRY_ASSIGN(auto decoded, decode_guarded<robot_covariates_t>(bytes, guard));

  DecodedCovariates result;
  result.robot_id = std::move(decoded.robot_id);
  result.message.utime_us = decoded.utime;
  result.message.covariates.reserve(count);
  for (std::size_t k = 0; k < count; ++k)
    result.message.covariates.push_back({std::move(decoded.name[k]), decoded.value[k]});
  return result;
}

Result<signals::EnergyState> decode_energy_state(std::span<const std::uint8_t> bytes) {
  static const std::int64_t fingerprint = energy_state_t::getHash();
  Guard guard(bytes, fingerprint);
  guard.fixed(8, "utime");
  guard.text("robot_id", Text::id, signals::max_robot_id_length);
  guard.text("mission_id", Text::optional_id, signals::max_mission_id_length);
  guard.fixed(8, "model_version");
  guard.fixed(16 * real, "measured_power to winding_temperature");
  TRY_ASSIGN(auto decoded, decode_guarded<energy_state_t>(bytes, guard));

  signals::EnergyState state;
  visit_energy_state(decoded, state, [](auto& from, auto& to) { to = std::move(from); });
  return state;
}

Result<std::vector<std::uint8_t>> encode_telemetry(std::string_view robot_id, const signals::Sample& sample) {
  TRY(check_text("robot_id", robot_id, Text::id, signals::max_robot_id_length));
  std::vector<std::uint8_t> bytes;
  bytes.reserve(28 + robot_id.size() + 1 + signals::sample_numbers * real);
  const auto put = [&bytes](std::uint64_t value, std::size_t size) {
    while (size-- > 0) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * size)));
  };
  put(static_cast<std::uint64_t>(robot_telemetry_t::getHash()), 8);
  put(static_cast<std::uint64_t>(sample.utime_us), 8);
  put(static_cast<std::uint64_t>(sample.sequence), 8);
  put(robot_id.size() + 1, 4);
  bytes.insert(bytes.end(), robot_id.begin(), robot_id.end());
  bytes.push_back(0);
  signals::visit_fields(sample, [&](const signals::SampleField&, double number) {
    put(std::bit_cast<std::uint64_t>(number), real);
  });
  return bytes;
}

Result<std::vector<std::uint8_t>> encode_mission_event(std::string_view robot_id,
                                                       const signals::MissionEvent& event) {
  TRY(check_text("robot_id", robot_id, Text::id, signals::max_robot_id_length));
  TRY(check_text("mission_id", event.mission_id, Text::id, signals::max_mission_id_length));
  TRY(check_text("note", event.note, Text::note, signals::max_note_length));
  mission_event_t message;
  message.utime = event.utime_us;
  message.robot_id = robot_id;
  message.mission_id = event.mission_id;
  message.event = static_cast<std::int8_t>(event.phase);
  message.payload_mass = event.payload_kg;
  message.note = event.note;
  return encode(message);
}

Result<std::vector<std::uint8_t>> encode_covariates(std::string_view robot_id,
                                                    const signals::CovariateMessage& message) {
  TRY(check_text("robot_id", robot_id, Text::id, max_covariates_robot_id_length));
  const std::size_t count = message.covariates.size();
  if (count > signals::max_covariates)
    return invalid("n", "is " + std::to_string(count) + "; 0 to " + std::to_string(signals::max_covariates) +
                            " are allowed");
  robot_covariates_t out;
  out.utime = message.utime_us;
  out.robot_id = robot_id;
  out.n = static_cast<std::int32_t>(count);
  for (std::size_t k = 0; k < count; ++k) {
    const auto& [name, value] = message.covariates[k];
    TRY(check_text("name[" + std::to_string(k) + "]", name, Text::covariate_name, max_covariate_text));
    out.name.push_back(name);
    out.value.push_back(value);
  }
  return encode(out);
}

Result<std::vector<std::uint8_t>> encode_energy_state(const signals::EnergyState& state) {
  TRY(check_text("robot_id", state.robot_id, Text::id, signals::max_robot_id_length));
  TRY(check_text("mission_id", state.mission_id, Text::optional_id, signals::max_mission_id_length));
  energy_state_t message;
  visit_energy_state(message, state, [](auto& to, const auto& from) { to = from; });
  return encode(message);
}

}  // namespace joulecast::telemetry
