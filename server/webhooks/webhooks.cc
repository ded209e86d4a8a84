#include "server/webhooks/webhooks.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "access/secret_file.h"
#include "access/sha256.h"
#include "base/fault_boundary.h"
#include "base/json_fields.h"
#include "base/json_writer.h"
#include "base/text_file.h"
#include "base/try.h"

namespace joulecast::server {
namespace {

constexpr std::int64_t microseconds_per_s = 1'000'000;

using Json = nlohmann::json;

constexpr std::size_t longest_text = 2048;
constexpr std::size_t shortest_secret = 16;

void read_events(Fields& fields, std::set<std::string>& events) {
  const Json* list = fields.member("events");
  if (list == nullptr) {
    events = event_kinds();
    return;
  }
  if (!list->is_array() || list->empty()) return fields.fault("events", "must be an array of kinds");
  for (const Json& kind : *list) {
    if (!kind.is_string() || !event_kinds().contains(kind.get<std::string>()))
      return fields.fault(
          "events", fmt::format("has {}; the kinds are {}", kind.dump(), fmt::join(event_kinds(), ", ")));
    events.insert(kind.get<std::string>());
  }
}

Result<Webhook> read_webhook(const Json& value, const std::string& at, const std::filesystem::path& folder) {
  Fields fields(value, at);
  Webhook webhook;
  const std::string url = fields.text("url", longest_text);
  const std::string secret_file = fields.text("secret_file", longest_text);
  read_events(fields, webhook.events);
  TRY(fields.finish());
  TRY_ASSIGN(auto address, http_client::parse_url(url, at + "/url"));
  webhook.host = address.host + ':' + address.port;
  webhook.address = std::move(address);
  auto secret = access::read_secret((folder / secret_file).string(), shortest_secret);
  if (!secret) return invalid(at + "/secret_file", describe(secret.error()));
  webhook.secret = std::move(*secret);
  return webhook;
}

Result<std::vector<Webhook>> parse(std::string_view text, const std::filesystem::path& folder) {
  TRY_ASSIGN(const auto list, read_list(text, "webhooks"));
  std::vector<Webhook> webhooks;
  for (std::size_t k = 0; k < list.size(); ++k) {
    TRY_ASSIGN(auto webhook, read_webhook(list[k], "/webhooks/" + std::to_string(k), folder));
    webhooks.push_back(std::move(webhook));
  }
  return webhooks;
}

}  // namespace

// One webhook with its queue and its thread.
class Webhooks::Sender {
 public:
  struct Delivery {
    std::string id, kind, body;
  };

  Sender(Webhook webhook, const Options& options) : webhook_(std::move(webhook)), options_(options) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  bool wants(std::string_view kind) const { return webhook_.events.contains(std::string(kind)); }

  void offer(const Delivery& delivery) {
    {
      const std::lock_guard lock(mutex_);
      if (queue_.size() >= options_.queue) {
        queue_.pop_front();
        ++counts_.dropped;
      }
      queue_.push_back(delivery);
    }
    wake_.notify_one();
  }

  void tell_to_stop() { thread_.request_stop(); }
  void stop() { thread_ = {}; }

  Status status() const {
    const std::lock_guard lock(mutex_);
    Status status{webhook_.host, counts_};
    status.counts.waiting = queue_.size() + (sending_ ? 1 : 0);
    return status;
  }

 private:
  void run(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, stop, [this] { return !queue_.empty(); });
      if (stop.stop_requested()) return;
      const Delivery next = std::move(queue_.front());
      queue_.pop_front();
      sending_ = true;
      deliver(next, lock, stop);
      sending_ = false;
    }
  }

  // Tries until it is answered, given up or the service stops. Called and returns with the lock.
  void deliver(const Delivery& delivery, std::unique_lock<std::mutex>& lock, const std::stop_token& stop) {
    std::chrono::milliseconds pause = options_.first_pause;
    for (int attempt = 1; !stop.stop_requested(); ++attempt) {
      lock.unlock();
      Result<void> sent = fail(Fault::internal, webhook_.host, "the attempt broke off");
      survive("webhooks", [&] { sent = post(delivery); });
      lock.lock();
      if (sent) {
        ++counts_.delivered;
        failing_ = false;
        return;
      }
      ++counts_.failed;
      if (!std::exchange(failing_, true) && options_.on_error) options_.on_error(sent.error());
      if (attempt >= options_.attempts) {
        ++counts_.given_up;
        return;
      }
      wake_.wait_for(lock, stop, pause, [] { return false; });
      pause = std::min(2 * pause, options_.last_pause);
    }
  }

  Result<void> post(const Delivery& delivery) const {
    const std::int64_t seconds = options_.now_utime_us() / microseconds_per_s;
    const http_client::HttpRequest request{
        http_client::HttpMethod::post,
        webhook_.address.base_path.empty() ? "/" : "",
        delivery.body,
        {{"Joulecast-Event", delivery.kind},
         {"Joulecast-Delivery", delivery.id},
         {"Joulecast-Signature", webhook_signature(webhook_.secret, seconds, delivery.body)}},
        {},
        true};
    TRY_ASSIGN(const auto reply, http_client::exchange(webhook_.address, request, options_.timeout));
    if (!reply.ok())
      return fail(Fault::unavailable, webhook_.host, "answered " + std::to_string(reply.status));
    return {};
  }

  const Webhook webhook_;
  const Options& options_;
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<Delivery> queue_;
  Counts counts_;
  bool sending_ = false, failing_ = false;
  std::jthread thread_;
};

Webhooks::Webhooks(std::vector<Webhook> webhooks, Options options)
    : options_(std::move(options)), id_prefix_(access::random_hex(8)) {
  for (Webhook& webhook : webhooks)
    senders_.push_back(std::make_unique<Sender>(std::move(webhook), options_));
}

Webhooks::~Webhooks() {
  stop();
}

void Webhooks::offer(std::string_view kind, std::string_view robot_id, std::int64_t utime_us,
                     std::string_view data) {
  const auto wants = [kind](const auto& sender) { return sender->wants(kind); };
  if (std::ranges::none_of(senders_, wants)) return;
  Sender::Delivery delivery{id_prefix_ + "-" + std::to_string(next_id_++), std::string(kind), {}};
  JsonWriter body;
  body.begin_object().field("id", delivery.id).field("event", kind).time("", utime_us).key("robot_id");
  robot_id.empty() ? body.null() : body.value(robot_id);
  body.key("data").raw(data).end_object();
  delivery.body = body.take();
  for (const auto& sender : senders_)
    if (wants(sender)) sender->offer(delivery);
}

void Webhooks::stop() {
  for (const auto& sender : senders_) sender->tell_to_stop();
  for (const auto& sender : senders_) sender->stop();
}

std::vector<Webhooks::Status> Webhooks::status() const {
  std::vector<Status> all;
  for (const auto& sender : senders_) all.push_back(sender->status());
  return all;
}

std::string webhook_signature(std::string_view secret, std::int64_t seconds, std::string_view body) {
  const std::string time = std::to_string(seconds);
  const auto code = access::hmac_sha256(secret, time + "." + std::string(body));
  const std::string_view bytes(reinterpret_cast<const char*>(code.data()), code.size());
  return "t=" + time + ",v1=" + access::hexadecimal(bytes);
}

Result<std::vector<Webhook>> read_webhooks(const std::string& path) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return fail(text.error().fault, "webhooks.file", describe(text.error()));
  Result<std::vector<Webhook>> webhooks = parse(*text, std::filesystem::path(path).parent_path());
  if (!webhooks) return invalid("webhooks.file", path + ": " + describe(webhooks.error()));
  return webhooks;
}

const std::set<std::string>& event_kinds() {
  static const std::set<std::string> kinds{
      "charge_low",          "charge_restored", "charged",       "contradiction",
      "contradiction_ended", "gap_diagnosed",   "gap_drift",     "gap_sibling",
      "host_clock_step",     "internal_fault",  "mission",       "mission_annulled",
      "mission_id_reused",   "model_activated", "model_adopted", "proposal_dismissed",
      "robot_back",          "robot_removed",   "robot_silent",  "undeclared_payload"};
  return kinds;
}

}  // namespace joulecast::server
