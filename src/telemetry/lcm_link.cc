#include "telemetry/lcm_link.h"

#include <lcm/lcm.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/core/noncopyable.hpp>
#include <cerrno>
#include <cstring>
#include <exception>
#include <limits>
#include <optional>
#include <utility>

#include "base/try.h"
#include "telemetry/codec.h"
#include "telemetry/datagram_socket.h"

namespace joulecast::telemetry {
namespace {

constexpr int queue_capacity =
    100'000;  // messages that liblcm holds unhandled before it drops new ones silently

}  // namespace

struct LcmLink::State : boost::noncopyable {
  struct LcmDestroyer {
    void operator()(lcm_t* lcm) const noexcept { lcm_destroy(lcm); }
  };

  ~State() {
    lcm.reset();  // before the handler that it may still call
    if (wake_fd >= 0) ::close(wake_fd);
  }

  // Called from LCM's C frames: nothing may be thrown through them.
  static void receive(const lcm_recv_buf_t* buffer, const char* channel, void* user) noexcept {
    State& state = *static_cast<State*>(user);
    if (state.thrown) return;
    try {
      state.handler(
          {channel, {static_cast<const std::uint8_t*>(buffer->data), buffer->data_size}, buffer->recv_utime});
    } catch (...) {
      state.thrown = std::current_exception();
    }
  }

  // Handles one message of liblcm, and returns whether another one waits.
  Result<bool> handle_one(pollfd waiting) {
    if (lcm_handle(lcm.get()) != 0) return fail(Fault::unavailable, "lcm", "the provider ended: " + url);
    if (thrown) std::rethrow_exception(std::exchange(thrown, nullptr));
    waiting.revents = 0;
    if (::poll(&waiting, 1, 0) < 0 && errno != EINTR)
      return fail(Fault::unavailable, "lcm", std::strerror(errno));
    return (waiting.revents & POLLIN) != 0;
  }

  std::string url;
  std::optional<UdpmUrl> udpm;
  std::unique_ptr<lcm_t, LcmDestroyer> lcm;
  std::unique_ptr<DatagramSocket> socket;  // of udpm, once listening
  Handler handler;
  std::exception_ptr thrown;
  int wake_fd = -1;
};

LcmLink::LcmLink(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
LcmLink::LcmLink(LcmLink&&) noexcept = default;
LcmLink& LcmLink::operator=(LcmLink&&) noexcept = default;
LcmLink::~LcmLink() = default;

Result<void> check_lcm_url(const std::string& provider_url) {
  const std::string scheme = provider_url.substr(0, provider_url.find("://"));
  if (scheme == "udpm") return parse_udpm_url(provider_url).map([](const UdpmUrl&) {});
  if (scheme == "memq" || scheme == "file" || scheme == "tcpq") return {};
  return invalid("lcm.url", "'" + provider_url + "' must begin with udpm://, tcpq://, file:// or memq://");
}

Result<LcmLink> LcmLink::open(const std::string& provider_url) {
  TRY(check_lcm_url(provider_url));
  auto state = std::make_unique<State>();
  state->url = provider_url;
  if (provider_url.starts_with("udpm")) state->udpm = *parse_udpm_url(provider_url);
  state->wake_fd = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (state->wake_fd < 0) return fail(Fault::unavailable, "lcm", std::strerror(errno));
  state->lcm.reset(lcm_create(provider_url.c_str()));
  if (!state->lcm)
    return fail(
        Fault::unavailable, "lcm.url",
        "cannot open the provider " + provider_url +
            (state->udpm ? "; multicast needs a route, on a computer without a network: `ip link set lo "
                           "multicast on && ip route add 224.0.0.0/4 dev lo`"
                         : ""));
  return LcmLink(std::move(state));
}

Result<void> LcmLink::listen(Handler handler, DatagramCounters& counters, const ListenOptions& options) {
  if (state_->handler) return fail(Fault::conflict, "lcm", "the link is already listening");
  if (state_->udpm) {
    TRY_ASSIGN(AcceptedSenders accepted, AcceptedSenders::parse(options.accept_from));
    TRY_ASSIGN(state_->socket,
               DatagramSocket::open(*state_->udpm, options.interface_address, std::move(accepted), counters));
  } else {
    for (const Subject subject : {Subject::telemetry, Subject::mission_event, Subject::covariates}) {
      lcm_subscription_t* made =
          lcm_subscribe(state_->lcm.get(), channel_pattern(subject).c_str(), &State::receive, state_.get());
      if (made == nullptr) return fail(Fault::internal, "lcm", "LCM refuses a channel pattern");
      lcm_subscription_set_queue_capacity(made, queue_capacity);
    }
  }
  state_->handler = std::move(handler);
  return {};
}

Result<void> LcmLink::publish(const std::string& channel, std::span<const std::uint8_t> data) {
  if (data.size() > std::numeric_limits<unsigned>::max() ||
      lcm_publish(state_->lcm.get(), channel.c_str(), data.data(), static_cast<unsigned>(data.size())) != 0)
    return fail(Fault::unavailable, channel, "LCM did not publish " + std::to_string(data.size()) + " bytes");
  return {};
}

Result<int> LcmLink::poll(std::chrono::milliseconds timeout, int max_messages) {
  State& state = *state_;
  // liblcm would open its own receiver to give a descriptor of UDP; poll() passes over negative ones.
  const int source = state.socket ? state.socket->descriptor()
                     : state.udpm ? -1
                                  : lcm_get_fileno(state.lcm.get());
  std::array<pollfd, 2> waiting{pollfd{source, POLLIN, 0}, pollfd{state.wake_fd, POLLIN, 0}};
  const auto wait_ms = std::clamp<std::chrono::milliseconds::rep>(timeout.count(), 0, 1'000'000'000);
  if (::poll(waiting.data(), waiting.size(), static_cast<int>(wait_ms)) < 0) {
    if (errno == EINTR) return 0;
    return fail(Fault::unavailable, "lcm", std::strerror(errno));
  }
  if ((waiting[1].revents & POLLIN) != 0) {
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t got = ::read(state.wake_fd, &count, sizeof count);
  }
  if (state.socket)
    return state.socket->receive(
        max_messages, [&](const Sender& sender, const ChannelMessage& message, std::int64_t utime_us) {
          state.handler({message.channel, message.data, utime_us, sender});
        });
  int handled = 0;
  for (bool more = (waiting[0].revents & POLLIN) != 0; more && handled < max_messages; ++handled) {
    TRY_ASSIGN(more, state.handle_one(waiting[0]));
  }
  return handled;
}

void LcmLink::wake() noexcept {
  const std::uint64_t one = 1;
  // Only a full counter can refuse, and then a wake-up is pending already.
  [[maybe_unused]] const ssize_t put = ::write(state_->wake_fd, &one, sizeof one);
}

}  // namespace joulecast::telemetry
