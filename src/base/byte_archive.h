#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

// Structures as bytes, for programs of one machine type. `Members` lists the members of a structure, for
// both ways:
//   struct Members {
//     template <class Archive> static void of(Archive& a, Thing& t) { a(t.name, t.values); }
//   };
namespace joulecast {

template <class T>
concept PlainValue = std::is_arithmetic_v<T> || std::is_enum_v<T>;

template <class Members>
class ByteArchive {
 public:
  // Appends values to `out`.
  explicit ByteArchive(std::vector<std::byte>* out) : out_(out) {}
  // Reads values into empty ones. Beyond the end of the bytes all are empty, and sound() is false.
  explicit ByteArchive(std::span<const std::byte> bytes) : rest_(bytes) {}

  template <class... T>
  void operator()(T&... values) {
    (pass(values), ...);
  }
  bool sound() const { return sound_; }
  bool at_end() const { return rest_.empty(); }

 private:
  void pass_bytes(void* value, std::size_t size) {
    if (out_ != nullptr) {
      const auto* bytes = static_cast<const std::byte*>(value);
      out_->insert(out_->end(), bytes, bytes + size);
      return;
    }
    sound_ = sound_ && size <= rest_.size();
    if (!sound_ || size == 0) return;
    std::memcpy(value, rest_.data(), size);
    rest_ = rest_.subspan(size);
  }
  // Of things that take a byte each at least.
  std::size_t pass_count(std::uint64_t number) {
    pass_bytes(&number, sizeof(number));
    sound_ = sound_ && (out_ != nullptr || number <= rest_.size());
    return sound_ ? number : 0;
  }
  template <PlainValue T>
  void pass(T& value) {
    if constexpr (std::same_as<T, bool>) {
      std::uint8_t byte = value ? 1 : 0;
      pass_bytes(&byte, 1);
      value = byte != 0;
    } else {
      pass_bytes(&value, sizeof(T));
    }
  }
  void pass(std::string& text) {
    text.resize(pass_count(text.size()));
    pass_bytes(text.data(), text.size());
  }
  template <class T>
  void pass(std::optional<T>& value) {
    bool there = value.has_value();
    pass(there);
    if (there && sound_) pass(value ? *value : value.emplace());
  }
  template <class T, std::size_t n>
  void pass(std::array<T, n>& values) {
    for (T& value : values) pass(value);
  }
  template <class T>
  void pass(std::vector<T>& values) {
    const std::size_t count = pass_count(values.size());
    for (std::size_t k = 0; k < count && sound_; ++k)
      pass(k < values.size() ? values[k] : values.emplace_back());
  }
  template <class T>
  void pass(std::map<std::string, T>& values) {
    auto next = values.begin();
    for (std::size_t left = pass_count(values.size()); left > 0 && sound_; --left) {
      std::string name = next == values.end() ? "" : (next++)->first;
      pass(name);
      pass(values[name]);
    }
  }
  template <class T>
  requires(std::is_class_v<T> && !std::same_as<T, std::string>) void pass(T& value) {
    Members::of(*this, value);
  }

  std::vector<std::byte>* out_ = nullptr;
  std::span<const std::byte> rest_;
  bool sound_ = true;
};

}  // namespace joulecast
