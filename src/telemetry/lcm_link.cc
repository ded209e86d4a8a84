#include "telemetry/lcm_link.h"

#include <lcm/lcm.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <limits>
#include <utility>
#include <vector>

namespace joulecast::telemetry {
namespace {

struct LcmDestroyer {
  void operator()(lcm_t* lcm) const noexcept { lcm_destroy(lcm); }
};

}  // namespace

struct LcmLink::State {
  struct Subscription {
    State* owner;
    Handler handler;
  };

  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    lcm.reset();  // before the handlers that it may still call
    if (wake_fd >= 0) ::close(wake_fd);
  }

  // Called from LCM's C frames: nothing may be thrown through them.
  static void receive(const lcm_recv_buf_t* buffer, const char* channel, void* user) noexcept {
    auto& subscription = *static_cast<Subscription*>(user);
    std::exception_ptr& thrown = subscription.owner->thrown;
    if (thrown) return;
    try {
      subscription.handler(
          {channel, {static_cast<const std::uint8_t*>(buffer->data), buffer->data_size}, buffer->recv_utime});
    } catch (...) {
      thrown = std::current_exception();
    }
  }

  std::string url;
  std::unique_ptr<lcm_t, LcmDestroyer> lcm;
  std::vector<std::unique_ptr<Subscription>> subscriptions;
  std::exception_ptr thrown;
  int wake_fd = -1;
};

LcmLink::LcmLink(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
LcmLink::LcmLink(LcmLink&&) noexcept = default;
LcmLink& LcmLink::operator=(LcmLink&&) noexcept = default;
LcmLink::~LcmLink() = default;

Result<LcmLink> LcmLink::open(const std::string& provider_url) {
  auto state = std::make_unique<State>();
  state->url = provider_url;
  state->wake_fd = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (state->wake_fd < 0) return fail(Fault::unavailable, "lcm", std::strerror(errno));
  state->lcm.reset(lcm_create(provider_url.c_str()));
  if (!state->lcm) return fail(Fault::unavailable, "lcm", "cannot open the provider " + provider_url);
  return LcmLink(std::move(state));
}

Result<void> LcmLink::subscribe(const std::string& pattern, Handler handler, int queue_capacity) {
  if (queue_capacity < 1) return invalid("queue_capacity", "must be at least 1");
  auto subscription =
      std::make_unique<State::Subscription>(State::Subscription{state_.get(), std::move(handler)});
  lcm_subscription_t* made =
      lcm_subscribe(state_->lcm.get(), pattern.c_str(), &State::receive, subscription.get());
  if (made == nullptr) return invalid("pattern", "LCM refuses the channel pattern " + pattern);
  state_->subscriptions.push_back(std::move(subscription));
  lcm_subscription_set_queue_capacity(made, queue_capacity);
  return {};
}

Result<void> LcmLink::publish(const std::string& channel, std::span<const std::uint8_t> data) {
  if (data.size() > std::numeric_limits<unsigned>::max() ||
      lcm_publish(state_->lcm.get(), channel.c_str(), data.data(), static_cast<unsigned>(data.size())) != 0) {
    return fail(Fault::unavailable, channel, "LCM did not publish " + std::to_string(data.size()) + " bytes");
  }
  return {};
}

Result<int> LcmLink::poll(std::chrono::milliseconds timeout, int max_messages) {
  std::array<pollfd, 2> waiting{pollfd{lcm_get_fileno(state_->lcm.get()), POLLIN, 0},
                                pollfd{state_->wake_fd, POLLIN, 0}};
  const auto wait_ms = std::clamp<std::chrono::milliseconds::rep>(timeout.count(), 0, 1'000'000'000);
  if (::poll(waiting.data(), waiting.size(), static_cast<int>(wait_ms)) < 0) {
    if (errno == EINTR) return 0;
    return fail(Fault::unavailable, "lcm", std::strerror(errno));
  }
  if ((waiting[1].revents & POLLIN) != 0) {
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t got = ::read(state_->wake_fd, &count, sizeof count);
  }
  int handled = 0;
  while ((waiting[0].revents & POLLIN) != 0 && handled < max_messages) {
    if (lcm_handle(state_->lcm.get()) != 0) {
      return fail(Fault::unavailable, "lcm", "the provider ended: " + state_->url);
    }
    if (state_->thrown) std::rethrow_exception(std::exchange(state_->thrown, nullptr));
    ++handled;
    waiting[0].revents = 0;
    if (::poll(waiting.data(), 1, 0) < 0 && errno != EINTR) {
      return fail(Fault::unavailable, "lcm", std::strerror(errno));
    }
  }
  return handled;
}

void LcmLink::wake() noexcept {
  const std::uint64_t one = 1;
  // Only a full counter can refuse, and then a wake-up is pending already.
  [[maybe_unused]] const ssize_t put = ::write(state_->wake_fd, &one, sizeof one);
}

std::string escape_regex(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    if (!plain) escaped += '\\';
    escaped += c;
  }
  return escaped;
}

}  // namespace joulecast::telemetry
