// SPDX-License-Identifier: Apache-2.0
// Integer cells of space and an open-addressing map from them, used by the searches in this folder.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace plumb {

/// A cell of a cubic lattice, packed into 21 bits per axis, so within +-2^20 cells of the origin.
class LatticeCell {
 public:
  static constexpr int kLimit = 1 << 20;
  LatticeCell(int x, int y, int z) : x_(x), y_(y), z_(z) {}
  [[nodiscard]] static int Index(float coordinate, float inverse_size) {
    return static_cast<int>(std::floor(coordinate * inverse_size));
  }
  [[nodiscard]] std::uint64_t key() const { return (Part(x_) << 42) | (Part(y_) << 21) | Part(z_); }

 private:
  static std::uint64_t Part(int index) {
    return static_cast<std::uint64_t>(index + kLimit) & 0x1FFFFFU;
  }
  int x_, y_, z_;
};

/// Map from packed cells to small integers. It grows and never shrinks. Iteration is not offered,
/// so that results cannot depend on its order.
class CellMap {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  /// Removes all cells and reserves space for about `expected` of them.
  void Reset(std::size_t expected) {
    const std::size_t capacity = std::bit_ceil(std::max<std::size_t>(64, 2 * expected));
    slots_.assign(capacity, Slot{});
    size_ = 0;
  }

  [[nodiscard]] std::uint32_t Find(std::uint64_t key) const {
    std::size_t at = Start(key);
    while (slots_[at].value != kNone) {
      if (slots_[at].key == key) return slots_[at].value;
      at = (at + 1) & (slots_.size() - 1);
    }
    return kNone;
  }

  /// The value of the cell; a new cell gets `value_if_new`.
  [[nodiscard]] std::uint32_t& FindOrAdd(std::uint64_t key, std::uint32_t value_if_new) {
    if (2 * (size_ + 1) > slots_.size()) Grow();
    std::size_t at = Start(key);
    while (slots_[at].value != kNone && slots_[at].key != key) at = (at + 1) & (slots_.size() - 1);
    if (slots_[at].value == kNone) {
      slots_[at] = {key, value_if_new};
      ++size_;
    }
    return slots_[at].value;
  }

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t value = kNone;
  };

  [[nodiscard]] std::size_t Start(std::uint64_t key) const {
    return ((key * 0x9E3779B97F4A7C15ULL) >> 32) & (slots_.size() - 1);
  }

  void Grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.value == kNone) continue;
      std::size_t at = Start(slot.key);
      while (slots_[at].value != kNone) at = (at + 1) & (slots_.size() - 1);
      slots_[at] = slot;
    }
  }

  std::vector<Slot> slots_ = std::vector<Slot>(64);
  std::size_t size_ = 0;
};

}  // namespace plumb
