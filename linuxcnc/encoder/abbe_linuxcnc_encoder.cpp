// SPDX-License-Identifier: GPL-2.0-or-later
// abbe-linuxcnc-encoder: sends to abbed the scale readings of a LinuxCNC control as CANopen
// encoders on CAN over UDP. It reads the stream of the realtime component `sampler`.
#include <arpa/inet.h>
#include <hal.h>
#include <netinet/in.h>
#include <rtapi.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "abbe/protocol/exit_codes.hpp"
#include "abbe/protocol/option_values.hpp"
#include "encoder_frames.hpp"

namespace {

using namespace abbe::linuxcnc;

using abbe::protocol::ExitCode;
constexpr int kDone = number(ExitCode::Done), kUsage = number(ExitCode::Usage),
              kIo = number(ExitCode::Io), kInternal = number(ExitCode::Internal);
// key of sampler.0 in LinuxCNC 2.9; further samplers have the following keys
constexpr int kSamplerKey = 0x48534130;
// columns (cfg=) of the sampler: motor (3), offset (3), homed
constexpr char kColumns[] = "ffffffb";
constexpr std::chrono::microseconds kPollPeriod{200};
// shortest time between two reported changes
constexpr std::chrono::milliseconds kReportPeriod{100};

volatile sig_atomic_t stop_requested = 0;

struct Options {
  std::string peer = "127.0.0.1";
  std::uint16_t peer_port = 0, local_port = 0, simulator_port = 0;
  std::uint32_t servo_period_ns = 1'000'000;
  int channel = 0;
  std::uint32_t every = 5;
  EncoderBusOptions bus;
};

/// The component in HAL, attached to the stream of a sampler.
class SamplerStream {
 public:
  /// The name contains the id of this process, because the name of a program that was killed stays
  /// in HAL.
  explicit SamplerStream(int channel)
      : id_(hal_init(("abbe-encoder-" + std::to_string(::getpid())).c_str())) {
    if (id_ < 0) return;
    hal_ready(id_);
    attached_ = hal_stream_attach(&stream_, id_, kSamplerKey + channel, kColumns) >= 0;
  }
  ~SamplerStream() {
    if (attached_) hal_stream_detach(&stream_);
    if (id_ >= 0) hal_exit(id_);
  }
  SamplerStream(const SamplerStream&) = delete;
  SamplerStream& operator=(const SamplerStream&) = delete;

  [[nodiscard]] bool attached() const { return attached_; }

  /// Reads all waiting samples.
  void read(std::vector<ServoSample>& samples) {
    samples.clear();
    hal_stream_data values[HAL_STREAM_MAX_PINS];
    unsigned number = 0;
    while (hal_stream_read(&stream_, values, &number) >= 0) {
      ServoSample sample;
      sample.number = number;
      for (std::size_t i = 0; i < kEncoderJoints; ++i) {
        sample.motor_mm[i] = values[i].f;
        sample.offset_mm[i] = values[kEncoderJoints + i].f;
      }
      sample.homed = values[2 * kEncoderJoints].b;
      samples.push_back(sample);
    }
  }

 private:
  int id_;
  hal_stream_t stream_{};
  bool attached_ = false;
};

/// A UDP socket on `local_port`, connected to `peer_port` of `peer_name`; -1: refused.
int open_socket(std::uint16_t local_port, const std::string& peer_name, std::uint16_t peer_port) {
  sockaddr_in local{}, peer{};
  local.sin_family = peer.sin_family = AF_INET;
  local.sin_port = htons(local_port);
  peer.sin_port = htons(peer_port);
  if (::inet_pton(AF_INET, peer_name.c_str(), &peer.sin_addr) != 1) return -1;
  // If the peer is on this computer, the socket is also bound to the loopback interface.
  if ((ntohl(peer.sin_addr.s_addr) >> 24) == 127) local.sin_addr.s_addr = htonl(INADDR_LOOPBACK);

  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto bound = [&](int (*call)(int, const sockaddr*, socklen_t), sockaddr_in& address) {
    return call(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  };
  if (fd >= 0 && bound(::bind, local) && bound(::connect, peer)) return fd;
  if (fd >= 0) ::close(fd);
  return -1;
}

/// Prints changes of the state: why the control has no positions, or that it has positions.
class Reporter {
 public:
  void report(const Causes& causes, std::chrono::steady_clock::time_point now) {
    if (causes == reported_ || (reported_ && now - reported_at_ < kReportPeriod)) return;
    reported_ = causes;
    reported_at_ = now;
    std::fprintf(stderr, "abbe-linuxcnc-encoder: %s\n", describe(causes).c_str());
  }

 private:
  std::optional<Causes> reported_;
  std::chrono::steady_clock::time_point reported_at_{};
};

int run(const Options& options) {
  SamplerStream stream(options.channel);
  if (!stream.attached()) {
    std::fprintf(
        stderr,
        "abbe-linuxcnc-encoder: no stream of sampler.%d with cfg=%s: LinuxCNC does not run, "
        "or its HAL file does not load that sampler\n",
        options.channel, kColumns);
    return kIo;
  }
  const int fd = open_socket(options.local_port, options.peer, options.peer_port);
  if (fd < 0) {
    std::fprintf(stderr, "abbe-linuxcnc-encoder: no UDP socket from port %u to %s:%u: %s\n",
                 unsigned{options.local_port}, options.peer.c_str(), unsigned{options.peer_port},
                 std::strerror(errno));
    return kIo;
  }

  const int simulator =
      options.simulator_port == 0 ? -1 : open_socket(0, "127.0.0.1", options.simulator_port);

  if (options.simulator_port != 0 && simulator < 0) {
    std::fprintf(stderr, "abbe-linuxcnc-encoder: no UDP socket to the simulator, port %u: %s\n",
                 unsigned{options.simulator_port}, std::strerror(errno));
    ::close(fd);
    return kIo;
  }

  Decimation decimation(options.every);
  EmergencySchedule schedule;
  Reporter reporter;
  std::vector<ServoSample> samples;
  std::uint8_t sequence = 0;
  std::uint64_t sent = 0;
  stream.read(samples);  // discards the samples from before the start
  while (stop_requested == 0) {
    stream.read(samples);
    for (const ServoSample& sample : simulator < 0 ? std::vector<ServoSample>{} : samples) {
      const auto record = abbe::protocol::encode(position_record(sample, options.servo_period_ns));
      (void)::send(simulator, record.data(), record.size(), MSG_DONTWAIT);
    }
    if (const auto due = decimation.choose(samples)) {
      const auto causes = causes_of(*due, options.bus);
      reporter.report(causes, std::chrono::steady_clock::now());
      const auto datagram =
          encoder_datagram(*due, sequence++, options.bus, schedule.choose(due->number, causes));
      // Without a receiver the datagram is lost, as on a bus without a listener.
      sent += ::send(fd, datagram.data(), datagram.size(), MSG_DONTWAIT) > 0 ? 1 : 0;
    }
    std::this_thread::sleep_for(kPollPeriod);
  }

  ::close(fd);
  if (simulator >= 0) ::close(simulator);
  std::fprintf(
      stderr, "abbe-linuxcnc-encoder: %llu cycles sent, %llu omitted because they were late\n",
      static_cast<unsigned long long>(sent), static_cast<unsigned long long>(decimation.late()));
  return kDone;
}

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Sends the scale readings of LinuxCNC to abbed as CANopen encoders on CAN over UDP. In "
      "abbed.toml: [encoder] transport = \"udp\", sync = \"external\", local_port = --peer-port, "
      "peer_port = --local-port, sync_period_us = servo period times --every."};
  app.set_version_flag("--version", "abbe-linuxcnc-encoder " ABBE_VERSION);
  Options options;
  app.add_option("--peer", options.peer, "IPv4 address of abbed")->capture_default_str();
  app.add_option("--peer-port", options.peer_port, "UDP port of abbed")->required();
  app.add_option("--local-port", options.local_port, "UDP port of this program")->required();
  app.add_option("--channel", options.channel, "number of the sampler")
      ->check(CLI::Range(0, 7))
      ->capture_default_str();
  app.add_option("--every", options.every, "send every n-th servo cycle")
      ->check(CLI::Range(1U, 100U))
      ->capture_default_str();
  app.add_option("--simulator-port", options.simulator_port,
                 "UDP port of abbe-sim on this computer ([sim.control] port), whose machine then "
                 "follows every servo cycle; 0: none")
      ->capture_default_str();
  app.add_option("--servo-period-ns", options.servo_period_ns,
                 "SERVO_PERIOD of the control, for --simulator-port")
      ->check(CLI::Range(100'000U, 100'000'000U))
      ->capture_default_str();
  app.add_option("--first-node", options.bus.first_node, "node of joint 0; the others follow")
      ->check(CLI::Range(1, 125))
      ->capture_default_str();

  try {
    abbe::protocol::check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  try {
    stop_on_signals();
    return run(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "abbe-linuxcnc-encoder: internal error: %s\n", e.what());
    return kInternal;
  }
}
