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
class ByteSaver {
 public:
  explicit ByteSaver(std::vector<std::byte>& out) : out_(out) {}
  template <class... T>
  void operator()(T&... values) {
    (put(values), ...);
  }

 private:
  template <PlainValue T>
  void put(T value) {
    const auto* bytes = reinterpret_cast<const std::byte*>(&value);
    out_.insert(out_.end(), bytes, bytes + sizeof(T));
  }
  void put(const std::string& text) {
    put(std::uint64_t{text.size()});
    const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
    out_.insert(out_.end(), bytes, bytes + text.size());
  }
  template <class T>
  void put(std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  template <class T, std::size_t n>
  void put(std::array<T, n>& values) {
    for (T& value : values) put(value);
  }
  template <class T>
  void put(std::vector<T>& values) {
    put(std::uint64_t{values.size()});
    for (T& value : values) put(value);
  }
  template <class T>
  void put(std::map<std::string, T>& values) {
    put(std::uint64_t{values.size()});
    for (auto& [name, value] : values) {
      put(name);
      put(value);
    }
  }
  template <class T>
  requires(std::is_class_v<T> && !std::same_as<std::remove_const_t<T>, std::string>) void put(T& value) {
    Members::of(*this, value);
  }

  std::vector<std::byte>& out_;
};

// Beyond the end of the bytes all values read as empty, and sound() is false.
template <class Members>
class ByteLoader {
 public:
  explicit ByteLoader(std::span<const std::byte> bytes) : rest_(bytes) {}
  template <class... T>
  void operator()(T&... values) {
    (get(values), ...);
  }
  bool sound() const { return sound_; }
  bool at_end() const { return rest_.empty(); }

 private:
  bool take(void* into, std::size_t size) {
    sound_ = sound_ && size <= rest_.size();
    if (!sound_) return false;
    if (size > 0) std::memcpy(into, rest_.data(), size);
    rest_ = rest_.subspan(size);
    return true;
  }
  // Of things that take a byte each at least.
  std::size_t count() {
    std::uint64_t number = 0;
    if (!take(&number, sizeof(number)) || number > rest_.size()) {
      sound_ = false;
      return 0;
    }
    return number;
  }
  // A failure of take() is recorded in sound_.
  template <PlainValue T>
  void get(T& value) {
    if constexpr (std::same_as<T, bool>) {
      std::uint8_t byte = 0;
      (void)take(&byte, 1);
      value = byte != 0;
    } else {
      (void)take(&value, sizeof(T));
    }
  }
  void get(std::string& text) {
    text.resize(count());
    (void)take(text.data(), text.size());
  }
  template <class T>
  void get(std::optional<T>& value) {
    bool there = false;
    get(there);
    if (there && sound_) get(value.emplace());
  }
  template <class T, std::size_t n>
  void get(std::array<T, n>& values) {
    for (T& value : values) get(value);
  }
  template <class T>
  void get(std::vector<T>& values) {
    for (std::size_t left = count(); left > 0 && sound_; --left) get(values.emplace_back());
  }
  template <class T>
  void get(std::map<std::string, T>& values) {
    for (std::size_t left = count(); left > 0 && sound_; --left) {
      std::string name;
      get(name);
      get(values[name]);
    }
  }
  template <class T>
  requires(std::is_class_v<T> && !std::same_as<T, std::string>) void get(T& value) {
    Members::of(*this, value);
  }

  std::span<const std::byte> rest_;
  bool sound_ = true;
};

}  // namespace joulecast
