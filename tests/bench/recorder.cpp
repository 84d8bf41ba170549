// The processor time of recording per sample, compared with write() of the same number of bytes,
// and how many times faster than real time a recording is read. The recording is ten minutes of a
// calibration: 2000 axis samples and 500 tracker points per second, and their raw bytes.

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/recording/recorder.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace {

using namespace abbe;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t kSeconds = 600;
constexpr std::uint32_t kAxisRate_hz = 2000;
constexpr std::uint32_t kTrackerRate_hz = 500;
constexpr std::uint32_t kSamples = kSeconds * (kAxisRate_hz + kTrackerRate_hz);
constexpr int kRounds = 5;

double seconds(auto duration) {
  return std::chrono::duration<double>(duration).count();
}

/// Processor time of this process, user and system.
double cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto s = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return s(usage.ru_utime) + s(usage.ru_stime);
}

struct Cost {
  double wall_s = 0.0;
  double cpu_s = 0.0;
};

template <class Work>
Cost measure(Work&& work) {
  const double cpu = cpu_seconds();
  const auto start = Clock::now();
  work();
  return {seconds(Clock::now() - start), cpu_seconds() - cpu};
}

template <class Work>
Cost median_of_rounds(Work&& work) {
  std::vector<Cost> costs;
  for (int round = 0; round < kRounds; ++round) costs.push_back(measure(work));
  std::ranges::nth_element(costs, costs.begin() + kRounds / 2, {}, &Cost::cpu_s);
  return costs[kRounds / 2];
}

protocol::HostTime time_at(std::uint32_t i, std::uint32_t rate_hz) {
  return protocol::HostTime{std::chrono::nanoseconds{std::int64_t{i} * 1'000'000'000 / rate_hz}};
}

void record_second(daemon::Recorder& recorder, std::uint32_t second, bool raw) {
  protocol::AxisSample axes;
  axes.axis_count = 3;
  for (std::uint32_t i = 0; i < kAxisRate_hz; ++i) {
    axes.head.time = time_at(second * kAxisRate_hz + i, kAxisRate_hz);
    axes.position = {1e-6 * i, 0.1, 0.2};
    recorder.record(axes, "encoder");
  }

  protocol::TrackerPoint point;
  for (std::uint32_t i = 0; i < kTrackerRate_hz; ++i) {
    point.head.time = time_at(second * kTrackerRate_hz + i, kTrackerRate_hz);
    recorder.record(point, "tracker");
  }

  if (!raw) return;
  protocol::RawBlock block;
  block.length = 2048;
  block.bytes = {};

  // raw bytes of one second: 500 tracker points of 36 bytes, and TPDOs of the encoders
  for (std::uint32_t i = 0; i < 12; ++i) {
    block.time = time_at(second * 12 + i, 12);
    recorder.record(protocol::to_raw_bytes(block, "tracker"));
  }
}

std::filesystem::path record_all(const std::filesystem::path& folder, bool raw) {
  std::filesystem::remove(folder / "bench.mcap");
  daemon::RecorderOptions options;
  options.directory = folder;
  options.name = "bench";
  auto recorder = daemon::Recorder::open(options, {"M1", {}, 1.0, "", {}}, {});
  if (!recorder) throw std::runtime_error(recorder.error().text);

  for (std::uint32_t s = 0; s < kSeconds; ++s) {
    record_second(*recorder, s, raw);
    recorder->tick(daemon::Recorder::WallTime{std::chrono::seconds{s}});
  }

  const auto closed = recorder->close();
  if (!closed) throw std::runtime_error(closed.error().text);
  return closed->file;
}

/// Writes as many bytes as the recorder, with as many write() and sync calls: the minimum for any
/// recorder.
void write_all(const std::filesystem::path& folder, std::uint64_t bytes) {
  const auto file = folder / "plain";
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const std::vector<char> piece(bytes / kSeconds);
  for (std::uint32_t s = 0; s < kSeconds; ++s) {
    if (::write(fd, piece.data(), piece.size()) < 0) throw std::runtime_error("write");
    ::fdatasync(fd);
  }
  ::close(fd);
}

/// Number of messages of a mapped file, found by a scan that checks all checksums: what a reader of
/// a mapped file needs to open it.
std::uint64_t scan_mapped(const std::filesystem::path& file, std::uint64_t bytes) {
  const int fd = ::open(file.c_str(), O_RDONLY);
  void* const data = ::mmap(nullptr, bytes, PROT_READ, MAP_PRIVATE, fd, 0);
  ::close(fd);
  if (data == MAP_FAILED) throw std::runtime_error("mmap");
  std::uint64_t messages = 0;
  protocol::mcap::LinearScan scan{{static_cast<const std::byte*>(data), bytes}};
  while (const auto item = scan.next())
    if (item->chunk)
      for (protocol::mcap::MessageReader all{item->chunk->chunk.records}; all.next();) ++messages;
  ::munmap(data, bytes);
  return messages;
}

void report_reading(std::string_view what, const daemon::RecordingReader& reader,
                    const daemon::RecordingSink& sink) {
  std::uint64_t undecodable = 0;
  const Cost cost = median_of_rounds([&] { undecodable += reader.read(sink); });
  fmt::print("read {:<28} {:>9.3f} s  {:>7.1f} ns/message  {:>8.0f} x real time  {} undecodable\n",
             what, cost.wall_s, 1e9 * cost.wall_s / static_cast<double>(reader.message_count()),
             kSeconds / cost.wall_s, undecodable);
}

}  // namespace

int main() {
  std::string pattern = (std::filesystem::temp_directory_path() / "abbe-bench-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) return 4;
  const std::filesystem::path folder = pattern;

  std::filesystem::path file;
  const Cost record = median_of_rounds([&] { file = record_all(folder, true); });
  const auto bytes = std::filesystem::file_size(file);
  const Cost plain = median_of_rounds([&] { write_all(folder, bytes); });
  fmt::print("{} s of acquisition: {} samples, {:.1f} MB with raw bytes\n", kSeconds, kSamples,
             1e-6 * static_cast<double>(bytes));
  fmt::print(
      "record               {:>8.3f} s CPU  {:>7.1f} ns/sample  {:>6.3f} % of a core at 1x  "
      "{:>5.2f} % at "
      "20x\n",
      record.cpu_s, 1e9 * record.cpu_s / kSamples, 100 * record.cpu_s / kSeconds,
      2000 * record.cpu_s / kSeconds);
  fmt::print("plain write + sync   {:>8.3f} s CPU   ratio record/plain {:.2f} CPU, {:.2f} wall\n",
             plain.cpu_s, record.cpu_s / plain.cpu_s, record.wall_s / plain.wall_s);

  const Cost opening = median_of_rounds([&] { (void)daemon::RecordingReader::open(file); });
  const auto reader = daemon::RecordingReader::open(file);
  std::uint64_t mapped_messages = 0;
  const Cost mapped = median_of_rounds([&] { mapped_messages = scan_mapped(file, bytes); });
  if (mapped_messages != reader->message_count()) throw std::runtime_error("other messages");
  fmt::print("open, all checksums          {:>9.3f} s  ratio to a scan of the mapped file {:.2f}\n",
             opening.wall_s, opening.wall_s / mapped.wall_s);
  report_reading("in order, not decoded", *reader, {});
  std::uint64_t samples = 0;
  daemon::RecordingSink sink;
  sink.axis_sample = [&](const protocol::AxisSample&, std::string_view) { ++samples; };
  sink.tracker_point = [&](const protocol::TrackerPoint&, std::string_view) { ++samples; };
  report_reading("samples decoded", *reader, sink);
  sink.raw_block = [&](const protocol::RawBlock&, std::string_view) { ++samples; };
  report_reading("samples and raw bytes", *reader, sink);
  fmt::print("asked: at least 100 x real time\n");
  std::filesystem::remove_all(folder);
  return samples == 0 ? 1 : 0;
}
