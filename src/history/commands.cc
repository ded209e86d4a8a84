#include "history/commands.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <type_traits>
#include <utility>

#include "history/command_members.h"

namespace joulecast::history {
namespace {

// Adds up what the members of a command hold outside of it.
struct Weight {
  std::size_t bytes = 0;

  template <class... T>
  void operator()(const T&... values) {
    (add(values), ...);
  }

 private:
  void add(const std::string& text) { bytes += text.size(); }
  template <class T>
  void add(const std::optional<T>& value) {
    if (value) add(*value);
  }
  template <class T>
  void add(const std::vector<T>& values) {
    bytes += values.capacity() * sizeof(T);
    if constexpr (!std::is_trivially_copyable_v<T>)
      for (const T& value : values) add(value);
  }
  template <class T>
  void add(const std::map<std::string, T>& values) {
    constexpr std::size_t node = 64;  // allocated by std::map around an entry
    for (const auto& [name, value] : values) bytes += name.size() + sizeof(name) + sizeof(value) + node;
  }
  template <class T>
  void add(const T& value) {
    // The members are listed for archives, which also load them.
    if constexpr (!std::is_trivially_copyable_v<T>) CommandMembers::of(*this, const_cast<T&>(value));
  }
};

template <class T>
concept Fenced = requires(T command) {
  command.epoch;
};

template <class T>
const std::string& robot_of(const T& c) {
  if constexpr (requires { c.mission; }) {
    return c.mission.robot_id;
  } else if constexpr (requires { c.state.robot_id; }) {
    return c.state.robot_id;
  } else if constexpr (requires { c.learned; }) {
    return c.learned.robot_id;
  } else if constexpr (requires { c.event; }) {
    return c.event.robot_id;
  } else if constexpr (requires { c.proposal; }) {
    return c.proposal.robot_id;
  } else {
    return c.robot_id;
  }
}

}  // namespace

std::optional<Fence> fence_of(const Command& command) {
  return std::visit(
      []<class T>(const T& c) -> std::optional<Fence> {
        if constexpr (Fenced<T>)
          if (c.epoch != 0) return Fence{robot_of(c), c.epoch};
        return std::nullopt;
      },
      command);
}

void put_under(Command& command, Epoch epoch) {
  std::visit(
      [epoch]<class T>(T& c) {
        if constexpr (Fenced<T>) c.epoch = epoch;
      },
      command);
}

void Change::add_before(std::function<std::vector<Command>(std::int64_t)> commands) {
  follow = [first = std::move(commands), then = std::move(follow)](std::int64_t outcome) {
    std::vector<Command> all = first(outcome);
    if (then) std::ranges::move(then(outcome), std::back_inserter(all));
    return all;
  };
}

std::size_t weight_bytes(const Command& command) {
  Weight weight{sizeof(Command)};
  std::visit([&](const auto& c) { weight(c); }, command);
  if (const auto* c = std::get_if<CommitChange>(&command); c != nullptr && c->change->command)
    weight.bytes += weight_bytes(*c->change->command);
  return weight.bytes;
}

}  // namespace joulecast::history
