#pragma once
/// Lock-free queue of values between threads: a thread that is preempted inside it delays no other
/// thread. Allocates; not for the real-time path. First in, first out.

#include <algorithm>
#include <atomic>
#include <utility>
#include <vector>

namespace abbe::drivers {

template <class T>
class Mailbox {
 public:
  Mailbox() = default;
  Mailbox(const Mailbox&) = delete;
  Mailbox& operator=(const Mailbox&) = delete;
  ~Mailbox() { (void)take(); }

  /// Any thread.
  void put(T value) {
    Node* const node = new Node{std::move(value), newest_.load(std::memory_order_relaxed)};
    // release: pairs with the acquire in take()
    while (!newest_.compare_exchange_weak(node->older, node, std::memory_order_release,
                                          std::memory_order_relaxed)) {
    }
  }

  /// Any thread: takes all values that were put in since the last call, the oldest first.
  [[nodiscard]] std::vector<T> take() {
    std::vector<T> values;
    if (newest_.load(std::memory_order_relaxed) == nullptr) return values;
    // acquire: pairs with the release in put()
    for (Node* node = newest_.exchange(nullptr, std::memory_order_acquire); node != nullptr;) {
      values.push_back(std::move(node->value));
      delete std::exchange(node, node->older);
    }
    std::reverse(values.begin(), values.end());
    return values;
  }

 private:
  struct Node {
    T value;
    Node* older;
  };
  std::atomic<Node*> newest_{nullptr};
};

}  // namespace abbe::drivers
