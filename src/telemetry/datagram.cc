#include "telemetry/datagram.h"

#include <algorithm>
#include <boost/endian/conversion.hpp>
#include <cstring>
#include <utility>

#include "telemetry/codec.h"

namespace joulecast::telemetry {
namespace {

constexpr std::uint32_t short_magic = 0x4c433032;     // "LC02"
constexpr std::uint32_t fragment_magic = 0x4c433033;  // "LC03"
constexpr std::size_t short_header = 8, fragment_header = 20;
constexpr std::size_t max_channel_length = 63;

// Removes the channel's name from the front of `bytes` and returns it; empty if LCM allows no such name.
std::string_view take_channel(std::span<const std::uint8_t>& bytes) noexcept {
  const auto window = bytes.first(std::min(bytes.size(), max_channel_length + 1));
  const auto end = std::ranges::find(window, std::uint8_t{0});
  if (end == window.end()) return {};
  const auto length = static_cast<std::size_t>(end - window.begin());
  const std::string_view channel(reinterpret_cast<const char*>(bytes.data()), length);
  bytes = bytes.subspan(length + 1);
  return channel;
}

bool is_robots(std::string_view channel) noexcept {
  const std::optional<ChannelName> name = parse_channel(channel);
  return name && name->subject != Subject::energy_state;
}

}  // namespace

std::string to_string(const Sender& sender) {
  if (!sender.known()) return "an unknown sender";
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8)
    text += std::to_string(sender.address >> shift & 0xff) + (shift > 0 ? "." : ":");
  return text + std::to_string(sender.port);
}

std::nullopt_t DatagramReader::refuse_channel(std::string_view channel) {
  counters_.note_other_channel(channel);
  return refuse(DatagramFault::other_channel);
}

std::nullopt_t DatagramReader::refuse(DatagramFault fault) noexcept {
  counters_.add(fault);
  return std::nullopt;
}

std::optional<ChannelMessage> DatagramReader::take(const Sender& sender,
                                                   std::span<const std::uint8_t> datagram,
                                                   std::int64_t now_us) {
  counters_.received.fetch_add(1, std::memory_order_relaxed);
  if (datagram.size() < short_header) return refuse(DatagramFault::malformed);
  const std::uint32_t magic = boost::endian::load_big_u32(&datagram[0]);
  if (magic == fragment_magic) return take_fragment(sender, datagram, now_us);
  if (magic != short_magic) return refuse(DatagramFault::malformed);
  std::span<const std::uint8_t> data = datagram.subspan(short_header);
  const std::string_view channel = take_channel(data);
  if (channel.empty()) return refuse(DatagramFault::malformed);
  if (!is_robots(channel)) return refuse_channel(channel);
  return ChannelMessage{channel, data};
}

std::optional<DatagramReader::Fragment> DatagramReader::parse_fragment(
    std::span<const std::uint8_t> datagram) {
  if (datagram.size() < fragment_header) return refuse(DatagramFault::malformed);
  Fragment f{boost::endian::load_big_u32(&datagram[4]),  boost::endian::load_big_u32(&datagram[8]),
             boost::endian::load_big_u32(&datagram[12]), boost::endian::load_big_u16(&datagram[16]),
             boost::endian::load_big_u16(&datagram[18]), {},
             datagram.subspan(fragment_header)};
  if (f.size > max_message_bytes) return refuse(DatagramFault::too_large);
  if (f.number == 0) {
    f.channel = take_channel(f.data);
    if (f.channel.empty()) return refuse(DatagramFault::malformed);
  }
  const bool possible = f.number < f.count && f.count <= max_fragments && !f.data.empty() &&
                        f.offset < f.size && f.data.size() <= f.size - f.offset &&
                        (f.number > 0 || f.offset == 0);
  if (!possible) return refuse(DatagramFault::bad_fragment);
  if (f.number == 0 && !is_robots(f.channel)) return refuse_channel(f.channel);
  return f;
}

bool DatagramReader::fits(const Begun& message, const Fragment& fragment) {
  const auto end = static_cast<std::uint32_t>(fragment.offset + fragment.data.size());
  return message.count == fragment.count && message.data.size() == fragment.size &&
         std::ranges::all_of(message.spans,
                             [&](const auto& span) { return end <= span[0] || span[1] <= fragment.offset; });
}

std::vector<DatagramReader::Begun>::iterator DatagramReader::begin(const Sender& sender,
                                                                   const Fragment& fragment,
                                                                   std::int64_t now_us) {
  const auto is_senders = [&](const Begun& message) { return message.sender == sender; };
  const auto of_sender = static_cast<std::size_t>(std::ranges::count_if(begun_, is_senders));
  if (of_sender >= limits_.messages_a_sender) {
    begun_.erase(std::ranges::find_if(begun_, is_senders));
    counters_.add(DatagramFault::incomplete);
  } else if (begun_.size() >= limits_.messages) {
    begun_.erase(begun_.begin());
    counters_.add(DatagramFault::incomplete);
  }
  Begun& message = begun_.emplace_back();
  message.sender = sender;
  message.sequence = fragment.sequence;
  message.count = fragment.count;
  message.since_us = now_us;
  message.data.resize(fragment.size);
  return begun_.end() - 1;
}

std::optional<ChannelMessage> DatagramReader::take_fragment(const Sender& sender,
                                                            std::span<const std::uint8_t> datagram,
                                                            std::int64_t now_us) {
  expire(now_us);
  const std::optional<Fragment> fragment = parse_fragment(datagram);
  if (!fragment) return std::nullopt;
  auto message = std::ranges::find_if(begun_, [&](const Begun& each) {
    return each.sender == sender && each.sequence == fragment->sequence;
  });
  if (message == begun_.end()) {
    message = begin(sender, *fragment, now_us);
  } else if (message->count == fragment->count && message->came[fragment->number]) {
    return refuse(DatagramFault::duplicate_fragment);
  }
  if (!fits(*message, *fragment)) {
    begun_.erase(message);
    return refuse(DatagramFault::bad_fragment);
  }
  if (fragment->number == 0) message->channel = fragment->channel;
  std::memcpy(message->data.data() + fragment->offset, fragment->data.data(), fragment->data.size());
  message->came.set(fragment->number);
  message->bytes += fragment->data.size();
  message->spans.push_back(
      {fragment->offset, static_cast<std::uint32_t>(fragment->offset + fragment->data.size())});
  if (message->came.count() < message->count) return std::nullopt;
  const bool whole = message->bytes == message->data.size();  // no two overlap, so all bytes have come
  completed_ = std::move(*message);
  begun_.erase(message);
  if (!whole) return refuse(DatagramFault::bad_fragment);
  return ChannelMessage{completed_.channel, completed_.data};
}

void DatagramReader::expire(std::int64_t now_us) {
  const auto dropped = std::erase_if(
      begun_, [&](const Begun& message) { return now_us - message.since_us > limits_.timeout_us; });
  if (dropped > 0) counters_.add(DatagramFault::incomplete, dropped);
}

}  // namespace joulecast::telemetry
