#include "server/http/event_hub.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <unordered_map>
#include <utility>

#include "access/sha256.h"
#include "base/try.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

using Clock = std::chrono::steady_clock;

// A line break inside data would end the field; JSON text escapes them, so none is lost by this.
void append_line(std::string& out, std::string_view field, std::string_view value) {
  out.append(field).append(": ");
  for (const char c : value) out.push_back(c == '\n' || c == '\r' ? ' ' : c);
  out.push_back('\n');
}

}  // namespace

struct EventHub::Event {
  std::uint64_t number;
  std::string topic;
  std::string replaces;  // events of one name here outdate each other; empty: none does
  std::string text;      // as sent
};

// The queue is filled by publishers and emptied by the server's I/O thread.
struct EventHub::Subscriber : public StreamSource {
  Subscriber(const Options& options, std::string topic_in, std::string client_in)
      : topic(std::move(topic_in)),
        client(std::move(client_in)),
        limit(options.queue_bytes),
        heartbeat(options.heartbeat) {}

  Next pull(std::string& out) override {
    const std::lock_guard lock(mutex);
    if (overflowed) return Next::abort;
    out += notice;
    notice.clear();
    for (const auto& event : queue)
      if (event) out += event->text;
    empty_queue();
    const auto now = Clock::now();
    if (!out.empty()) {
      last_sent = now;
    } else if (now - last_sent >= heartbeat) {
      out += ": still here\n\n";
      last_sent = now;
    }
    return ended ? Next::end : Next::wait;
  }
  void on_wake(std::function<void()> wake_in) override {
    const std::lock_guard lock(mutex);
    wake = std::move(wake_in);
  }
  void cancel() override {
    const std::lock_guard lock(mutex);
    left = true;
    wake = nullptr;
    empty_queue();
  }
  bool must_close() const override { return overflowed; }
  bool endless() const override { return true; }
  bool on_worker() const override { return false; }

  // False when the queue is full for the first time: the client is to be dropped.
  bool offer(const std::shared_ptr<const Event>& event) {
    if (!topic.empty() && !event->topic.empty() && event->topic != topic) return true;
    std::function<void()> call;
    {
      const std::lock_guard lock(mutex);
      if (left || overflowed) return true;
      if (!event->replaces.empty()) {
        const auto [place, first] = newest.try_emplace(event->replaces, queue.size());
        if (!first) {
          queued_bytes -= queue[place->second]->text.size();
          queue[place->second].reset();
          place->second = queue.size();
        }
      }
      overflowed = queued_bytes + event->text.size() > limit;
      if (overflowed) empty_queue();
      if (queue.empty()) call = wake;
      if (!overflowed) {
        queue.push_back(event);
        queued_bytes += event->text.size();
      }
    }
    if (call) call();
    return !overflowed;
  }
  void finish() {
    std::function<void()> call;
    {
      const std::lock_guard lock(mutex);
      ended = true;
      call = wake;
    }
    if (call) call();
  }

  void empty_queue() {
    queue.clear();
    newest.clear();
    queued_bytes = 0;
  }

  const std::string topic, client;
  const std::size_t limit;
  const std::chrono::milliseconds heartbeat;
  std::mutex mutex;
  std::function<void()> wake;
  std::vector<std::shared_ptr<const Event>> queue;  // null: outdated before it was sent
  std::unordered_map<std::string, std::size_t>
      newest;          // where in the queue, of events that outdate each other
  std::string notice;  // sent once, before anything else
  std::size_t queued_bytes = 0;
  Clock::time_point last_sent = Clock::now();
  std::atomic<bool> overflowed{false};
  bool ended = false;
  bool left = false;
};

EventHub::EventHub() : EventHub(Options{}) {}
EventHub::EventHub(const Options& options) : options_(options), epoch_(access::random_hex(4)) {}

EventHub::~EventHub() {
  for (const auto& each : subscribers_)
    if (const auto subscriber = each.lock()) subscriber->finish();
}

void EventHub::publish(std::string_view event, std::string_view data, std::string_view topic, Of of) {
  const std::lock_guard lock(mutex_);
  auto entry = std::make_shared<Event>();
  entry->number = next_number_++;
  entry->topic = topic;
  if (of == Of::state) entry->replaces.append(event).append(" ").append(topic);
  append_line(entry->text, "event", event);
  append_line(entry->text, "id", epoch_ + "-" + std::to_string(entry->number));
  append_line(entry->text, "data", data);
  entry->text.push_back('\n');
  const std::shared_ptr<const Event> shared = std::move(entry);

  backlog_.push_back(shared);
  backlog_bytes_ += shared->text.size();
  while (backlog_bytes_ > options_.backlog_bytes && !backlog_.empty()) {
    backlog_bytes_ -= backlog_.front()->text.size();
    backlog_.pop_front();
  }
  // Under the lock, so that every subscriber sees the events in the order of their numbers.
  std::erase_if(subscribers_, [&](const auto& each) {
    const auto subscriber = each.lock();
    if (!subscriber) return true;
    if (subscriber->offer(shared)) return false;
    ++dropped_;
    return true;
  });
}

// With the mutex held.
bool EventHub::make_room(const std::string& client) {
  std::map<std::string, std::size_t> held;
  for (const auto& each : subscribers_)
    if (const auto subscriber = each.lock()) ++held[subscriber->client];
  const std::size_t own = held[client];
  if (!client.empty() && own >= std::max<std::size_t>(options_.max_subscribers / 4, 1)) return false;
  if (count_living() < options_.max_subscribers) return true;
  const auto most = std::ranges::max_element(held, {}, [](const auto& each) { return each.second; });
  if (most->second <= own) return false;
  for (auto each = subscribers_.begin(); each != subscribers_.end(); ++each) {
    const auto oldest = each->lock();
    if (!oldest || oldest->client != most->first) continue;
    subscribers_.erase(each);
    oldest->finish();
    return true;
  }
  return false;
}

Result<std::shared_ptr<StreamSource>> EventHub::subscribe(std::string_view last_event_id,
                                                          std::string_view topic, std::string_view client) {
  const std::lock_guard lock(mutex_);
  if (!make_room(std::string(client)))
    return fail(Fault::unavailable, "",
                "the limit of " + std::to_string(options_.max_subscribers) +
                    " event streams, or of a quarter of them for one client, is reached");
  auto subscriber = std::make_shared<Subscriber>(options_, std::string(topic), std::string(client));
  if (!last_event_id.empty()) {
    const auto dash = last_event_id.rfind('-');
    std::optional<std::uint64_t> number;
    if (dash != std::string_view::npos && last_event_id.substr(0, dash) == epoch_)
      number = to_number<std::uint64_t>(last_event_id.substr(dash + 1));
    const std::uint64_t oldest = backlog_.empty() ? next_number_ : backlog_.front()->number;
    if (number && *number + 1 >= oldest && *number < next_number_) {
      for (const auto& event : backlog_)
        if (event->number > *number) subscriber->offer(event);
    } else {
      append_line(subscriber->notice, "event", "reset");
      append_line(subscriber->notice, "id", epoch_ + "-" + std::to_string(next_number_ - 1));
      append_line(subscriber->notice, "data", "{}");
      subscriber->notice.push_back('\n');
    }
  }
  subscribers_.push_back(subscriber);
  return std::shared_ptr<StreamSource>(std::move(subscriber));
}

Result<Response> EventHub::respond(const Request& request, std::string_view topic) {
  TRY_ASSIGN(auto source, subscribe(request.header("last-event-id"), topic, request.client));
  Response response;
  response.content_type = "text/event-stream";
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("X-Accel-Buffering", "no");
  response.stream = std::move(source);
  return response;
}

std::size_t EventHub::count_living() const {
  std::erase_if(subscribers_, [](const auto& each) { return each.expired(); });
  return subscribers_.size();
}

EventHub::Counts EventHub::counts() const {
  const std::lock_guard lock(mutex_);
  return {next_number_ - 1, dropped_, count_living()};
}

}  // namespace joulecast::http
