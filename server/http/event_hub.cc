#include "server/http/event_hub.h"

#include <algorithm>
#include <atomic>
#include <deque>
#include <map>
#include <mutex>
#include <unordered_map>
#include <utility>
#include <vector>

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

struct EventHub::State {
  struct Event {
    std::uint64_t number;
    std::string topic;
    std::string replaces;  // events of one name here outdate each other; empty: none does
    std::string text;      // as sent
  };

  struct Subscriber;

  explicit State(const Options& given) : options(given), epoch(access::random_hex(4)) {}

  const Options options;
  const std::string epoch;
  mutable std::mutex mutex;
  std::uint64_t next_number = 1;
  std::deque<std::shared_ptr<const Event>> backlog;
  std::size_t backlog_bytes = 0;
  std::vector<std::weak_ptr<Subscriber>> subscribers;
  std::uint64_t dropped = 0;
  bool ended = false;

  // For another stream of that client, see subscribe().
  bool make_room(const std::string& client);

  std::size_t count_living() {
    std::erase_if(subscribers, [](const auto& each) { return each.expired(); });
    return subscribers.size();
  }
};

// The queue is filled by publishers and emptied by the server's I/O thread.
struct EventHub::State::Subscriber : public StreamSource {
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
EventHub::EventHub(const Options& options) : state_(std::make_shared<State>(options)) {}

EventHub::~EventHub() {
  std::vector<std::weak_ptr<State::Subscriber>> subscribers;
  {
    const std::lock_guard lock(state_->mutex);
    state_->ended = true;
    subscribers.swap(state_->subscribers);
  }
  for (const auto& each : subscribers)
    if (const auto subscriber = each.lock()) subscriber->finish();
}

void EventHub::publish(std::string_view event, std::string_view data, std::string_view topic) {
  send(event, data, topic, {});
}

void EventHub::publish_newest(std::string_view event, std::string_view data, std::string_view topic) {
  send(event, data, topic, std::string(event).append(" ").append(topic));
}

void EventHub::send(std::string_view event, std::string_view data, std::string_view topic,
                    std::string replaces) {
  const std::lock_guard lock(state_->mutex);
  auto entry = std::make_shared<State::Event>();
  entry->number = state_->next_number++;
  entry->topic = topic;
  entry->replaces = std::move(replaces);
  append_line(entry->text, "event", event);
  append_line(entry->text, "id", state_->epoch + "-" + std::to_string(entry->number));
  append_line(entry->text, "data", data);
  entry->text.push_back('\n');
  const std::shared_ptr<const State::Event> shared = std::move(entry);

  state_->backlog.push_back(shared);
  state_->backlog_bytes += shared->text.size();
  while (state_->backlog_bytes > state_->options.backlog_bytes && !state_->backlog.empty()) {
    state_->backlog_bytes -= state_->backlog.front()->text.size();
    state_->backlog.pop_front();
  }
  // Under the lock, so that every subscriber sees the events in the order of their numbers.
  std::erase_if(state_->subscribers, [&](const auto& each) {
    const auto subscriber = each.lock();
    if (!subscriber) return true;
    if (subscriber->offer(shared)) return false;
    ++state_->dropped;
    return true;
  });
}

// With the mutex held.
bool EventHub::State::make_room(const std::string& client) {
  std::map<std::string, std::size_t> held;
  for (const auto& each : subscribers)
    if (const auto subscriber = each.lock()) ++held[subscriber->client];
  const std::size_t own = held[client];
  if (!client.empty() && own >= std::max<std::size_t>(options.max_subscribers / 4, 1)) return false;
  if (count_living() < options.max_subscribers) return true;
  const auto most = std::ranges::max_element(held, {}, [](const auto& each) { return each.second; });
  if (most->second <= own) return false;
  for (auto each = subscribers.begin(); each != subscribers.end(); ++each) {
    const auto oldest = each->lock();
    if (!oldest || oldest->client != most->first) continue;
    subscribers.erase(each);
    oldest->finish();
    return true;
  }
  return false;
}

Result<std::shared_ptr<StreamSource>> EventHub::subscribe(std::string_view last_event_id,
                                                          std::string_view topic, std::string_view client) {
  const std::lock_guard lock(state_->mutex);
  if (!state_->make_room(std::string(client)))
    return fail(Fault::unavailable, "",
                "the limit of " + std::to_string(state_->options.max_subscribers) +
                    " event streams, or of a quarter of them for one client, is reached");
  auto subscriber =
      std::make_shared<State::Subscriber>(state_->options, std::string(topic), std::string(client));
  if (!last_event_id.empty()) {
    const auto dash = last_event_id.rfind('-');
    std::optional<std::uint64_t> number;
    if (dash != std::string_view::npos && last_event_id.substr(0, dash) == state_->epoch)
      number = parse_number<std::uint64_t>(last_event_id.substr(dash + 1));
    const std::uint64_t oldest =
        state_->backlog.empty() ? state_->next_number : state_->backlog.front()->number;
    if (number && *number + 1 >= oldest && *number < state_->next_number) {
      for (const auto& event : state_->backlog)
        if (event->number > *number) subscriber->offer(event);
    } else {
      append_line(subscriber->notice, "event", "reset");
      append_line(subscriber->notice, "id", state_->epoch + "-" + std::to_string(state_->next_number - 1));
      append_line(subscriber->notice, "data", "{}");
      subscriber->notice.push_back('\n');
    }
  }
  state_->subscribers.push_back(subscriber);
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

EventHub::Counts EventHub::counts() const {
  const std::lock_guard lock(state_->mutex);
  return {state_->next_number - 1, state_->dropped, state_->count_living()};
}

}  // namespace joulecast::http
