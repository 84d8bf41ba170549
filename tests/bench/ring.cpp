// Question: does the sample ring transfer as many samples per second between two threads as the
// faster of boost::lockfree::spsc_queue and moodycamel::ReaderWriterQueue? Requirement: median
// ratio >= 0.95 over >= 21 rounds. Each round runs all three, in an order that rotates with every
// round, and gives one ratio: rate of the sample ring / rate of the faster other queue. The rate of
// a queue in a round is that of the fastest of five short runs, because a run in which a thread
// lost its processor does not measure the queue. Writer: one push per sample, as receive() does,
// repeated while the queue is full (no sample is dropped, so all queues transfer the same samples).
// Reader: in batches of 64 where the queue supports batches (the sample ring, boost), else one by
// one (moodycamel). Further lines of the output show the best rate of each queue, of the sample
// ring and boost also with pushes in batches of 16.
//
// The sample ring is boost's queue plus the treatment of a full queue in this project: the sample
// is dropped, counted, and the next one marked. So the comparison with boost measures the cost of
// this treatment: a check of the loss counter, and a marked copy after each full queue, which is
// frequent with this writer.
//
//   bench_ring [rounds = 41] [samples per run = 200000]

#include <pthread.h>
#include <readerwriterqueue/readerwriterqueue.h>
#include <sched.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <thread>
#include <vector>

#include "abbe/drivers/sample_ring.hpp"
#include "abbe/protocol/samples.hpp"

namespace {

using abbe::protocol::AxisSample;
using abbe::protocol::TrackerPoint;

constexpr std::size_t kCapacity = 1024;
constexpr std::size_t kReadBatch = 64;
constexpr std::uint32_t kWriteBatch = 16;
constexpr std::uint32_t kPrepared = 512;  // a multiple of kWriteBatch
constexpr int kRunsPerRound = 5;

void number(TrackerPoint& p, std::int32_t i) {
  p.device_status = i;
}
void number(AxisSample& s, std::int32_t i) {
  s.cycle = static_cast<std::uint32_t>(i);
}
std::uint32_t number_of(const TrackerPoint& p) {
  return static_cast<std::uint32_t>(p.device_status);
}
std::uint32_t number_of(const AxisSample& s) {
  return s.cycle;
}

/// Index of the i-th prepared sample: blocks of kWriteBatch in a scattered order. In a regular
/// order a prepared sample would have the same address modulo 4096 as its slot in the queue during
/// a whole run, or never, depending on the addresses that the heap returned. The processor makes a
/// load whose address matches an earlier store modulo 4096 wait for the store; so these addresses
/// would change the rate by a factor of two.
std::uint32_t source_of(std::uint32_t i) {
  constexpr std::uint32_t kScatter = 13;  // coprime to the number of blocks
  return (i / kWriteBatch * kScatter * kWriteBatch + i % kWriteBatch) % kPrepared;
}

/// Adapter of the sample ring. The adapters of all queues have the same four functions; those that
/// push return the number of accepted samples.
template <class T>
struct Ours {
  abbe::drivers::SampleRing<T> ring{kCapacity};
  std::size_t push(const T& t) { return ring.try_push(t) ? 1 : 0; }
  std::size_t push(std::span<const T> batch) { return ring.push(batch); }
  std::size_t pop(std::span<T> out) { return ring.pop(out); }
};
template <class T>
struct Boost {
  boost::lockfree::spsc_queue<T, boost::lockfree::capacity<kCapacity>> queue;
  std::size_t push(const T& t) { return queue.push(t) ? 1 : 0; }
  std::size_t push(std::span<const T> batch) { return queue.push(batch.data(), batch.size()); }
  std::size_t pop(std::span<T> out) { return queue.pop(out.data(), out.size()); }
};
template <class T>
struct Moodycamel {
  moodycamel::ReaderWriterQueue<T> queue{kCapacity};
  std::size_t push(const T& t) { return queue.try_enqueue(t) ? 1 : 0; }
  std::size_t push(std::span<const T> batch) {
    std::size_t n = 0;
    while (n < batch.size() && queue.try_enqueue(batch[n])) ++n;
    return n;
  }
  std::size_t pop(std::span<T> out) {
    std::size_t n = 0;
    while (n < out.size() && queue.try_dequeue(out[n])) ++n;
    return n;
  }
};

/// Waits for the other thread: spins first, because it usually needs little time, then yields.
class Patience {
 public:
  void wait() {
    if (++turns_ % 2000 == 0) {
      std::this_thread::yield();
    } else {
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
    }
  }

 private:
  unsigned turns_ = 0;
};

/// Numbered samples in memory, as a decoder writes them. Samples made from constants would allow
/// the compiler to evaluate them in advance.
template <class T>
const std::vector<T>& prepared() {
  static const std::vector<T> samples = [] {
    std::vector<T> v(kPrepared);
    for (std::uint32_t i = 0; i < kPrepared; ++i) number(v[i], static_cast<std::int32_t>(i));
    return v;
  }();
  return samples;
}

template <class T, class Queue>
void write_one_by_one(Queue& queue, std::uint32_t samples) {
  Patience patience;
  const T* const source = prepared<T>().data();
  for (std::uint32_t i = 0; i < samples; ++i) {
    while (queue.push(source[source_of(i)]) == 0) patience.wait();
  }
}

template <class T, class Queue>
void write_batches(Queue& queue, std::uint32_t samples) {
  Patience patience;
  const std::span<const T> source = prepared<T>();
  for (std::uint32_t i = 0; i < samples; i += kWriteBatch) {
    for (auto rest = source.subspan(source_of(i), kWriteBatch); !rest.empty();) {
      const std::size_t n = queue.push(rest);
      rest = rest.subspan(n);
      if (n == 0) patience.wait();
    }
  }
}

/// Million samples per second, from the first push to the last pop. Ends the program if a sample is
/// missing or out of order.
template <class T, class Queue>
double run(bool batches, std::uint32_t samples) {
  auto queue = std::make_unique<Queue>();
  std::atomic<bool> ready{false};
  std::atomic<bool> go{false};

  std::thread writer([&] {
    ready = true;
    while (!go) std::this_thread::yield();
    batches ? write_batches<T>(*queue, samples) : write_one_by_one<T>(*queue, samples);
  });

  while (!ready) std::this_thread::yield();
  Patience patience;
  const auto begin = std::chrono::steady_clock::now();
  go = true;
  std::array<T, kReadBatch> out{};
  std::uint32_t expected = 0;

  while (expected < samples) {
    const std::size_t n = queue->pop(out);
    if (n == 0) patience.wait();
    for (std::size_t i = 0; i < n; ++i) {
      if (number_of(out[i]) != source_of(expected++)) {
        std::fprintf(stderr, "sample %u is missing or out of order\n", expected - 1);
        std::exit(1);
      }
    }
  }

  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  writer.join();
  return 1e-6 * samples / took.count();
}

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

template <class T>
double compare(const char* what, bool batches, int rounds, std::uint32_t samples) {
  const std::array<std::function<double()>, 3> runs{
      [&] { return run<T, Ours<T>>(batches, samples); },
      [&] { return run<T, Boost<T>>(batches, samples); },
      [&] { return run<T, Moodycamel<T>>(batches, samples); },
  };

  std::array<std::vector<double>, 3> rates;
  std::vector<double> ratios;
  for (int round = 0; round < rounds; ++round) {
    std::array<double, 3> rate{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t which = (k + static_cast<std::size_t>(round)) % 3;
      for (int i = 0; i < kRunsPerRound; ++i) rate[which] = std::max(rate[which], runs[which]());
      rates[which].push_back(rate[which]);
    }
    ratios.push_back(rate[0] / std::max(rate[1], rate[2]));
  }

  std::printf(
      "%-32s %4zu B  ours %7.1f  boost %7.1f  moodycamel %7.1f  M/s  median ratio to the better "
      "%.2f\n",
      what, sizeof(T), median(rates[0]), median(rates[1]), median(rates[2]), median(ratios));

  return median(ratios);
}

/// Requests real-time priority, because on a busy computer a run would measure the scheduler and
/// not the queue. Both threads inherit the priority.
bool take_priority() {
  const sched_param param{.sched_priority = 1};
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &param) == 0;
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 41;
  const std::uint32_t wanted = argc > 2 ? static_cast<std::uint32_t>(std::atoi(argv[2])) : 200'000;
  const std::uint32_t samples = wanted - wanted % kWriteBatch;
  const char* const scheduling =
      take_priority() ? "SCHED_FIFO" : "ordinary scheduling: no permission for SCHED_FIFO";
  std::printf("%d rounds of %u samples, capacity %zu, medians, %s\n", rounds, samples, kCapacity,
              scheduling);
  const double point =
      compare<TrackerPoint>("TrackerPoint, pushed one by one", false, rounds, samples);
  const double axes = compare<AxisSample>("AxisSample, pushed one by one", false, rounds, samples);
  compare<TrackerPoint>("TrackerPoint, pushed by 16", true, rounds, samples);
  compare<AxisSample>("AxisSample, pushed by 16", true, rounds, samples);
  const bool good = std::min(point, axes) >= 0.95;
  std::printf("asked >= 0.95 pushed one by one: %s\n", good ? "yes" : "no");

  return good ? 0 : 1;
}
