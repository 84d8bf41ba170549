#pragma once
/// Keeps the newest payload of each topic and key, which a durable topic sends to late joiners.
/// Entries are in the order of publication, oldest first, and are sent again in this order: a model
/// before the ModelState that names it. Single-threaded; allocates.

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/messages/topics.hpp"

namespace abbe::daemon {

/// Extra is data of the owner per entry, for example "still to send" or the time of the last write.
template <class Extra>
class RetainedPayloads {
 public:
  struct Entry {
    Topic topic;
    std::vector<std::byte> key;
    std::vector<std::byte> payload;
    Extra extra{};
  };

  /// Stores the payload at the end of the list, with a default Extra, and returns its entry.
  Entry& keep(Topic topic, std::span<const std::byte> key, std::span<const std::byte> payload) {
    const auto same = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) {
      return e.topic == topic && std::ranges::equal(e.key, key);
    });

    if (same == entries_.end()) {
      entries_.push_back({topic, {key.begin(), key.end()}, {}, {}});
    } else {
      std::rotate(same, same + 1, entries_.end());
    }

    Entry& entry = entries_.back();
    entry.payload.assign(payload.begin(), payload.end());
    entry.extra = {};
    if (topic == Topic::ErrorGrid) drop_surplus_slices(payload);

    return entries_.back();
  }

  [[nodiscard]] std::vector<Entry>& entries() noexcept { return entries_; }

 private:
  /// Removes slices with a number beyond those of the newest grid. They remain from the grid of the
  /// previous model, which had more slices.
  void drop_surplus_slices(std::span<const std::byte> newest) {
    const auto machine = payload_key(Topic::ErrorGrid, newest);
    const auto slices = grid_slices(newest);
    if (!machine || !slices) return;
    std::erase_if(entries_, [&](const Entry& e) {
      if (e.topic != Topic::ErrorGrid) return false;
      const auto key = payload_key(e.topic, e.payload);
      return key && key->machine == machine->machine && key->number >= slices;
    });
  }

  std::vector<Entry> entries_;
};

}  // namespace abbe::daemon
