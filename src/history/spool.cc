#include "history/spool.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <limits>
#include <utility>

#include "access/sha256.h"
#include "base/byte_archive.h"
#include "base/text_file.h"
#include "base/try.h"
#include "history/chunk_codec.h"
#include "history/command_members.h"

namespace joulecast::history {
namespace {

using Archive = ByteArchive<CommandMembers>;

// The header of a file: layouts differ in the size of one of their types.
std::string layout() {
  std::string text = "joulecast spool 4";
  for (const std::size_t size :
       {sizeof(Mission), sizeof(signals::Accounts), sizeof(CovariateSummary), sizeof(TraceBucket),
        sizeof(signals::Sample), sizeof(ResumeState), sizeof(DiagnosisRecord), sizeof(Proposal),
        sizeof(AddModel), std::variant_size_v<Command>})
    text += ' ' + std::to_string(size);
  return text + '\n';
}

template <std::size_t... index>
void get_command(Archive& load, std::size_t kind, Command& command, std::index_sequence<index...>) {
  ((kind == index ? load(command.emplace<index>()) : void()), ...);
}

tl::unexpected<Error> trouble(const std::string& path, const char* what) {
  return fail(Fault::unavailable, path, std::string(what) + ": " + std::strerror(errno));
}

// The file under another name, unless there is one of that name.
bool give_name(const std::string& path, const std::string& name) {
  return link(path.c_str(), name.c_str()) == 0 && unlink(path.c_str()) == 0;
}

// Answers the new name.
Result<std::string> put_aside(const std::string& path) {
  for (int k = 1;; ++k) {
    std::string name = path + ".refused-" + std::to_string(k);
    if (give_name(path, name)) return name;
    if (errno != EEXIST) return trouble(path, "cannot be put aside");
  }
}

Result<TakenSpool> refuse_spool(const std::string& path, const Error& why) {
  TRY_ASSIGN(const std::string name, put_aside(path));
  return fail(why.fault, path, why.message + "; it is kept as " + name);
}

Result<void> write_whole(const std::string& path, const Bytes& bytes) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) return trouble(path, "cannot be written");
  bool written = true;
  for (std::size_t at = 0; written && at < bytes.size();) {
    const ssize_t n = write(file, bytes.data() + at, bytes.size() - at);
    written = n > 0;
    if (written) at += static_cast<std::size_t>(n);
  }
  written = written && fsync(file) == 0;
  const Result<void> done = written ? Result<void>() : trouble(path, "cannot be written");
  close(file);
  if (!written) unlink(path.c_str());
  return done;
}

Result<TakenSpool> take_in(const std::string& path, Store& store,
                           const std::function<void(const Error&)>& refused) {
  TakenSpool taken;
  if (!std::filesystem::exists(path)) return taken;
  const Result<std::vector<Command>> commands = read_spool(path);
  if (!commands && commands.error().fault == Fault::corrupt) return refuse_spool(path, commands.error());
  if (!commands) return tl::unexpected(commands.error());
  taken.commands = commands->size() - 1;
  const std::uint64_t fenced = store.fenced(), samples = store.fenced_samples();
  TRY_ASSIGN(const auto outcomes, store.apply(*commands));
  const Outcome& first = outcomes.front();
  taken.before = !first && first.error().fault == Fault::invalid;
  if (!first && !taken.before) return refuse_spool(path, first.error());
  if (!taken.before) {
    taken.already = static_cast<std::size_t>(*first);
    taken.fenced = store.fenced() - fenced;
    taken.samples = store.fenced_samples() - samples;
    for (const Outcome& outcome : outcomes)
      if (!outcome) ++taken.refused, refused(outcome.error());
  }
  if (taken.refused + taken.fenced > 0) {
    TRY_ASSIGN(taken.kept_as, put_aside(path));
  } else if (unlink(path.c_str()) != 0) {
    return trouble(path, "is stored and cannot be removed");
  }
  return taken;
}

}  // namespace

Bytes command_bytes(std::span<const Command* const> commands) {
  Bytes plain;
  Archive save(&plain);
  std::size_t count = commands.size();
  save(count);
  for (const Command* command : commands) {
    std::size_t kind = command->index();
    save(kind);
    Command copy = *command;
    std::visit([&](auto& c) { save(c); }, copy);
  }
  return plain;
}

std::optional<std::vector<Command>> commands_of(std::span<const std::byte> bytes) {
  Archive load(bytes);
  std::size_t count = 0;
  load(count);
  std::vector<Command> commands;
  for (std::size_t k = 0; k < count && load.sound(); ++k) {
    std::size_t kind = 0;
    load(kind);
    get_command(load, kind, commands.emplace_back(),
                std::make_index_sequence<std::variant_size_v<Command>>());
    if (std::holds_alternative<CommitChange>(commands.back())) return std::nullopt;
  }
  if (!load.sound() || !load.at_end()) return std::nullopt;
  return commands;
}

Result<void> write_spool(const std::string& path, const TakeSpool& first,
                         std::span<const Command* const> commands) {
  const Command begin = first;
  std::vector<const Command*> all{&begin};
  all.insert(all.end(), commands.begin(), commands.end());
  const Bytes plain = command_bytes(all);
  Bytes file;
  for (const char c : layout()) file.push_back(static_cast<std::byte>(c));
  append_compressed(file, plain, 1);
  const std::string unfinished = path + ".unfinished";
  TRY(write_whole(unfinished, file));
  if (give_name(unfinished, path)) return {};
  if (errno != EEXIST) return trouble(path, "cannot be written");
  TRY_ASSIGN(const std::string name, put_aside(unfinished));
  return fail(Fault::conflict, path, "another spool exists; this one is kept as " + name);
}

Result<std::vector<Command>> read_spool(const std::string& path) {
  const Result<std::string> read = read_text_file(path, std::numeric_limits<std::int32_t>::max());
  if (!read) return fail(Fault::unavailable, path, read.error().message);
  const std::string& text = *read;
  const std::string begin = layout();
  if (!text.starts_with(begin))
    return fail(Fault::corrupt, path, "is not a spool that this version of the program wrote");
  const auto frame = std::as_bytes(std::span(text)).subspan(begin.size());
  const Result<Bytes> plain =
      decompressed(frame, std::numeric_limits<std::int32_t>::max(), "the spool's content");
  if (!plain) return fail(Fault::corrupt, path, describe(plain.error()));
  std::optional<std::vector<Command>> commands = commands_of(*plain);
  if (!commands || commands->empty()) return fail(Fault::corrupt, path, "is cut off");
  auto* first = std::get_if<TakeSpool>(&commands->front());
  if (first == nullptr) return fail(Fault::corrupt, path, "names no store");
  first->hash = access::sha256_hex(text);
  return std::move(*commands);
}

Result<TakenSpool> take_in_spool(const std::string& path, Store& store,
                                 const std::function<void(const Error&)>& refused) {
  Result<TakenSpool> taken = take_in(path, store, refused);
  if (!taken && taken.error().fault != Fault::corrupt && taken.error().fault != Fault::conflict) return taken;
  // An empty batch: from here on the last one is this program's, which its own spool will follow.
  TRY(store.apply({}));
  return taken;
}

}  // namespace joulecast::history
