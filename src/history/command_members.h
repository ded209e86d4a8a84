#pragma once

#include <cstdint>
#include <string_view>

#include "history/columns.h"
#include "history/commands.h"
#include "signals/archive_members.h"

namespace joulecast::history {

template <class Record>
concept Stored = requires(Record& record) {
  visit_columns(record, [](const auto&...) {});
};

// The members of commands and all that they hold, for the archive of base/byte_archive.h and for
// weight_bytes(): of a record its columns, else the members in their order. Numbers of members that of() does
// not list do not compile.
struct CommandMembers : signals::ArchiveMembers {
  using ArchiveMembers::of;
  template <class Archive, Stored Record>
  static void of(Archive& a, Record& record) {
    visit_columns(record, [&a](std::string_view, auto& value, auto...) { a(value); });
  }
  template <class Archive, class Command>
  requires(!Stored<Command>) static void of(Archive& a, Command& command) {
    if constexpr (requires { Command{{}, {}, {}, {}, {}, {}, {}, {}}; }) {
      auto& [first, second, third, fourth, fifth, sixth, seventh, eighth] = command;
      a(first, second, third, fourth, fifth, sixth, seventh, eighth);
    } else if constexpr (requires { Command{{}, {}, {}, {}, {}, {}, {}}; }) {
      auto& [first, second, third, fourth, fifth, sixth, seventh] = command;
      a(first, second, third, fourth, fifth, sixth, seventh);
    } else if constexpr (requires { Command{{}, {}, {}}; }) {
      auto& [first, second, third] = command;
      a(first, second, third);
    } else if constexpr (requires { Command{{}, {}}; }) {
      auto& [first, second] = command;
      a(first, second);
    } else {
      auto& [first] = command;
      a(first);
    }
  }
  // A change has a waiting caller, who is answered, so that none is spooled. Its address identifies it.
  template <class Archive>
  static void of(Archive& a, CommitChange& command) {
    auto address = reinterpret_cast<std::uintptr_t>(command.change.get());
    a(address);
  }
};

}  // namespace joulecast::history
