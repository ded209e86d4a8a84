#include "telemetry/event_log.h"

#include <algorithm>
#include <array>
#include <boost/endian/conversion.hpp>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/try.h"
#include "telemetry/codec.h"
#include "telemetry/datagram.h"

namespace joulecast::telemetry {
namespace {

constexpr std::array<std::uint8_t, 4> sync_bytes{0xED, 0xA1, 0xDA, 0x01};

struct Header {
  bool sync = false;
  std::int64_t number = 0;
  std::int64_t timestamp_us = 0;
  std::uint32_t channel_length = 0;
  std::uint32_t data_length = 0;

  explicit Header(const std::uint8_t* at) noexcept
      : sync(boost::endian::load_big_u32(at) == log_sync_word),
        number(boost::endian::load_big_s64(at + 4)),
        timestamp_us(boost::endian::load_big_s64(at + 12)),
        channel_length(boost::endian::load_big_u32(at + 20)),
        data_length(boost::endian::load_big_u32(at + 24)) {}

  // Negative lengths of the file are huge here and fail the same test.
  [[nodiscard]] bool plausible(const LogLimits& limits) const noexcept {
    return sync && channel_length >= 1 && channel_length <= limits.max_channel_length &&
           data_length <= limits.max_data_length;
  }
  [[nodiscard]] std::size_t total() const noexcept { return log_header_size + channel_length + data_length; }
};

}  // namespace

Result<EventLogReader> EventLogReader::open(const std::string& path, LogLimits limits) {
  std::FILE* const opened = std::fopen(path.c_str(), "rbe");
  if (opened == nullptr)
    return fail(errno == ENOENT ? Fault::not_found : Fault::unavailable, path, std::strerror(errno));
  return EventLogReader(
      [file = std::shared_ptr<std::FILE>(opened, std::fclose)](std::span<std::uint8_t> into) {
        const std::size_t got = std::fread(into.data(), 1, into.size(), file.get());
        return got == 0 && std::ferror(file.get()) != 0 ? std::ptrdiff_t{-1}
                                                        : static_cast<std::ptrdiff_t>(got);
      },
      limits);
}

EventLogReader::EventLogReader(Source source, LogLimits limits)
    : source_(std::move(source)), limits_(limits) {}

std::span<const std::uint8_t> EventLogReader::peek(std::size_t wanted) {
  if (filled_ - begin_ < wanted && !exhausted_) {
    // The bytes are moved to the front only where twice as many do not fit behind them: however often events
    // are sought, each byte is moved about once.
    if (buffer_.size() - begin_ < wanted) {
      if (begin_ > 0) std::memmove(buffer_.data(), buffer_.data() + begin_, filled_ - begin_);
      filled_ -= begin_;
      begin_ = 0;
      if (buffer_.size() < 2 * wanted) buffer_.resize(std::max(2 * wanted, limits_.read_size));
    }
    while (filled_ - begin_ < wanted && !exhausted_) {
      const std::ptrdiff_t got = source_(std::span(buffer_).subspan(filled_));
      failed_ = got < 0;
      exhausted_ = got <= 0;
      if (got > 0) filled_ += static_cast<std::size_t>(got);
    }
  }
  return {buffer_.data() + begin_, filled_ - begin_};
}

void EventLogReader::advance(std::size_t count) noexcept {
  begin_ += count;
  offset_ += count;
}

LogRead EventLogReader::next() {
  advance(std::exchange(pending_, 0));
  LogRead read;
  read.offset = offset_;

  auto bytes = peek(log_header_size);
  const auto ends_inside = [&](const char* part) {
    read.status = failed_ ? LogStatus::failed : LogStatus::truncated;
    read.message =
        failed_ ? "the rest of the log cannot be read" : std::string("the log ends inside ") + part;
    return read;
  };
  if (bytes.empty() && !failed_) {
    read.status = LogStatus::end;
    return read;
  }
  const std::size_t sync_there = std::min(bytes.size(), sync_bytes.size());
  if (!std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(sync_there),
                  sync_bytes.begin())) {
    read.status = LogStatus::corrupt;
    read.message = "no sync word where an event must begin";
    return read;
  }
  if (bytes.size() < log_header_size) return ends_inside("an event's header");

  const Header header(bytes.data());
  if (!header.plausible(limits_)) {
    read.status = LogStatus::corrupt;
    read.message = "an event declares a channel of " +
                   std::to_string(static_cast<std::int32_t>(header.channel_length)) + " and data of " +
                   std::to_string(static_cast<std::int32_t>(header.data_length)) + " bytes; 1 to " +
                   std::to_string(limits_.max_channel_length) + " and 0 to " +
                   std::to_string(limits_.max_data_length) + " are accepted";
    return read;
  }
  bytes = peek(header.total());
  if (bytes.size() < header.total()) return ends_inside("an event");

  read.status = LogStatus::event;
  read.event.number = header.number;
  read.event.timestamp_us = header.timestamp_us;
  read.event.channel = {reinterpret_cast<const char*>(bytes.data()) + log_header_size, header.channel_length};
  read.event.data = bytes.subspan(log_header_size + header.channel_length, header.data_length);
  pending_ = header.total();
  return read;
}

bool EventLogReader::begins_event() {
  auto bytes = peek(log_header_size);
  if (bytes.size() < log_header_size) return false;
  const Header header(bytes.data());
  if (!header.plausible(limits_)) return false;
  bytes = peek(header.total() + sync_bytes.size());
  if (bytes.size() == header.total()) return true;
  return bytes.size() >= header.total() + sync_bytes.size() &&
         std::equal(sync_bytes.begin(), sync_bytes.end(),
                    bytes.begin() + static_cast<std::ptrdiff_t>(header.total()));
}

std::uint64_t EventLogReader::resync() {
  const std::uint64_t from = offset_;
  pending_ = 0;
  if (!peek(1).empty()) advance(1);
  while (true) {
    const auto bytes = peek(sync_bytes.size());
    if (bytes.size() < sync_bytes.size()) {
      advance(bytes.size());
      break;
    }
    const auto* found =
        static_cast<const std::uint8_t*>(std::memchr(bytes.data(), sync_bytes[0], bytes.size()));
    if (found == nullptr) {
      advance(bytes.size());
      continue;
    }
    advance(static_cast<std::size_t>(found - bytes.data()));
    if (begins_event()) break;
    if (!peek(1).empty()) advance(1);
  }
  skipped_ += offset_ - from;
  return offset_ - from;
}

Result<bool> read_events(const std::string& path, const std::function<Result<bool>(const LogEvent&)>& take,
                         LogTally& tally, const std::function<void(const LogRead&)>& damaged) {
  TRY_ASSIGN(auto reader, EventLogReader::open(path));
  for (;;) {
    const LogRead read = reader.next();
    switch (read.status) {
      case LogStatus::event:
        if (const Result<bool> taken = take(read.event); !taken || !*taken) return taken;
        ++tally.events;
        if (parse_channel(read.event.channel)) {
          ++tally.of_robots;
        } else if (tally.other_channels.size() < DatagramCounters::max_other_channels) {
          tally.other_channels.emplace(read.event.channel);
        }
        break;
      case LogStatus::end:
        return true;
      case LogStatus::truncated:
      case LogStatus::corrupt:
        ++tally.damaged_places;
        if (damaged) damaged(read);
        tally.skipped_bytes += reader.resync();
        break;
      case LogStatus::failed:
        return fail(Fault::unavailable, path, read.message);
    }
  }
}

Result<EventLogWriter> EventLogWriter::create(const std::string& path) {
  std::FILE* file = std::fopen(path.c_str(), "wbe");
  if (file == nullptr) return fail(Fault::unavailable, path, std::strerror(errno));
  return EventLogWriter(file, path);
}

Result<void> EventLogWriter::write(std::int64_t timestamp_us, std::string_view channel,
                                   std::span<const std::uint8_t> data) {
  const LogLimits limits;
  if (channel.empty() || channel.size() > limits.max_channel_length)
    return invalid("channel", "must have 1 to " + std::to_string(limits.max_channel_length) + " characters");
  if (data.size() > limits.max_data_length)
    return invalid("data", "must have at most " + std::to_string(limits.max_data_length) + " bytes");
  if (!file_) return fail(Fault::unavailable, path_, "the log is closed");
  std::array<std::uint8_t, log_header_size> header{};
  boost::endian::store_big_u32(&header[0], log_sync_word);
  boost::endian::store_big_s64(&header[4], count_);
  boost::endian::store_big_s64(&header[12], timestamp_us);
  boost::endian::store_big_u32(&header[20], static_cast<std::uint32_t>(channel.size()));
  boost::endian::store_big_u32(&header[24], static_cast<std::uint32_t>(data.size()));
  if (std::fwrite(header.data(), 1, header.size(), file_.get()) != header.size() ||
      std::fwrite(channel.data(), 1, channel.size(), file_.get()) != channel.size() ||
      (!data.empty() && std::fwrite(data.data(), 1, data.size(), file_.get()) != data.size()))
    return fail(Fault::unavailable, path_, std::strerror(errno));
  ++count_;
  return {};
}

Result<void> EventLogWriter::close() {
  if (!file_) return {};
  if (std::fclose(file_.release()) != 0) return fail(Fault::unavailable, path_, std::strerror(errno));
  return {};
}

}  // namespace joulecast::telemetry
