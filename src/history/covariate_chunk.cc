#include "history/covariate_chunk.h"

#include <bit>
#include <cassert>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "base/try.h"
#include "history/chunk_bytes.h"

namespace joulecast::history {
namespace {

using signals::CovariateChange;

constexpr std::byte covariate_chunk_format{1};
constexpr std::size_t max_name_bytes = 2 * signals::max_covariate_name_length + 1;
// Every change may have a name of its own.
constexpr std::size_t max_covariate_bytes =
    max_chunk_changes * (3 * max_varint_bytes + max_name_bytes + 8) + 2 * max_varint_bytes + 9;

tl::unexpected<Error> corrupt_covariates(std::string message) {
  return fail(Fault::corrupt, "covariate chunk", std::move(message));
}

}  // namespace

std::vector<std::byte> encode_covariates(std::span<const CovariateChange> changes, int level) {
  assert(!changes.empty() && changes.size() <= max_chunk_changes);
  std::map<std::string_view, std::size_t> place;
  std::vector<std::int64_t> times;
  std::vector<std::uint64_t> values;
  Bytes of_names, places;
  for (const CovariateChange& change : changes) {
    const auto [entry, is_new] = place.emplace(change.name, place.size());
    if (is_new) {
      put_varint(of_names, change.name.size());
      for (const char c : change.name) of_names.push_back(static_cast<std::byte>(c));
    }
    times.push_back(change.utime_us);
    put_varint(places, entry->second);
    values.push_back(std::bit_cast<std::uint64_t>(change.value));
  }
  Bytes plain;
  put_varint(plain, place.size());
  plain.insert(plain.end(), of_names.begin(), of_names.end());
  put_varint(plain, changes.size());
  put_integers(plain, times);
  plain.insert(plain.end(), places.begin(), places.end());
  put_doubles(plain, values);
  Bytes out{covariate_chunk_format};
  append_compressed(out, plain, level);
  return out;
}

Result<std::vector<CovariateChange>> decode_covariates(std::span<const std::byte> bytes) {
  if (bytes.empty() || bytes.front() != covariate_chunk_format) return corrupt_covariates("unknown format");
  TRY_ASSIGN(const auto plain, decompressed(bytes.subspan(1), max_covariate_bytes, "covariate chunk"));
  ByteReader reader(plain);
  const auto name_count = reader.varint();
  if (!name_count || *name_count == 0 || *name_count > max_chunk_changes)
    return corrupt_covariates("number of names is out of range");
  std::vector<std::string> names;
  for (std::uint64_t k = 0; k < *name_count; ++k) {
    const auto length = reader.varint();
    if (!length || *length > max_name_bytes) return corrupt_covariates("length of a name is out of range");
    const auto text = reader.take(static_cast<std::size_t>(*length));
    if (!text) return corrupt_covariates("ends within a name");
    names.emplace_back(reinterpret_cast<const char*>(text->data()), text->size());
  }
  const auto count = reader.varint();
  if (!count || *count == 0 || *count > max_chunk_changes)
    return corrupt_covariates("number of changes is out of range");
  std::vector<std::int64_t> times(static_cast<std::size_t>(*count));
  if (!reader.integers(times)) return corrupt_covariates("ends within its times");
  std::vector<CovariateChange> changes(times.size());
  for (std::size_t k = 0; k < changes.size(); ++k) {
    const auto place = reader.varint();
    if (!place || *place >= names.size()) return corrupt_covariates("a change has no name");
    changes[k].utime_us = times[k];
    changes[k].name = names[static_cast<std::size_t>(*place)];
  }
  std::vector<std::uint64_t> values(changes.size());
  if (!reader.doubles(values)) return corrupt_covariates("ends within its values");
  if (!reader.at_end()) return corrupt_covariates("has bytes after its end");
  for (std::size_t k = 0; k < changes.size(); ++k) changes[k].value = std::bit_cast<double>(values[k]);
  return changes;
}

}  // namespace joulecast::history
