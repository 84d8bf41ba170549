#include "machine_hold_writer.hpp"

#include <fmt/format.h>
#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>
#include <system_error>
#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/base/wake_up.hpp"
#include "abbe/drivers/mailbox.hpp"
#include "abbe/drivers/status_board.hpp"
#include "machine_hold.hpp"

namespace abbe::daemon {
namespace {

Result<void> write_machine(const std::filesystem::path& file, const drivers::IppMachine& machine) {
  if (machine != drivers::IppMachine{}) {
    auto folder = create_folder(file.parent_path());
    return folder ? replace_file(file, hold_text(machine)) : folder;
  }

  std::error_code failed;
  // On a read-only file system the removal fails also if the file does not exist; this is not an
  // error.
  if (std::filesystem::symlink_status(file, failed).type() == std::filesystem::file_type::not_found)
    return {};
  std::filesystem::remove(file, failed);
  if (!failed) return {};
  return fail(ErrorCode::Io, fmt::format("remove {}: {}", file.string(), failed.message()));
}

}  // namespace

struct MachineHoldWriter::Work {
  struct State {
    std::uint64_t number = 0;
    drivers::IppMachine machine;
  };

  void run();
  void write(const State& state);

  std::filesystem::path file;
  std::optional<drivers::IppMachine> in_file;  // content of the file; nullopt: not known
  std::uint64_t kept = 0;                      // number of the latest state passed to keep()
  drivers::Mailbox<State> states = {};
  WakeUp wake = {}, ended = {};
  std::atomic<bool> ending{false};
  std::atomic<std::uint64_t> done{0};    // number of the latest state that is in the file
  std::atomic<std::uint64_t> failed{0};  // number of the latest state that could not be written
  drivers::FaultText fault = {};         // reason of the failure
};

MachineHoldWriter::MachineHoldWriter(std::filesystem::path file,
                                     std::optional<drivers::IppMachine> in_file)
    : work_(new Work{.file = std::move(file), .in_file = std::move(in_file)}),
      thread_([work = work_] { work->run(); }) {}

MachineHoldWriter::~MachineHoldWriter() {
  // release: pairs with the acquire in run()
  work_->ending.store(true, std::memory_order_release);
  work_->wake.signal();
  const bool in_time = work_->ended.wait_for(kEndTimeout);
  if (const auto now = stored(); !now.done)
    fmt::print(stderr,
               "abbed: {}: not saved ({}): after a restart the measuring machine may not await a "
               "release\n",
               work_->file.string(), now.fault.empty() ? "the disk does not answer" : now.fault);
  if (in_time)
    thread_.join();
  else
    thread_.detach();
}

void MachineHoldWriter::keep(const drivers::IppMachine& machine) {
  work_->states.put({++work_->kept, machine});
  work_->wake.signal();
}

drivers::IppStored MachineHoldWriter::stored() const {
  // acquire: pairs with the releases in write()
  if (work_->done.load(std::memory_order_acquire) == work_->kept)
    return {.done = true, .fault = {}};
  const bool failed = work_->failed.load(std::memory_order_acquire) == work_->kept;
  return {.done = false, .fault = failed ? work_->fault.read().text : std::string{}};
}

void MachineHoldWriter::Work::run() {
  (void)::pthread_setname_np(::pthread_self(), "abbe-cmm-hold");
  State latest;
  for (bool last = false; !last;) {
    // acquire: pairs with the release in the destructor. Its thread makes no further call of
    // keep().
    last = ending.load(std::memory_order_acquire);
    for (State& state : states.take()) latest = std::move(state);
    const bool outstanding = latest.number != done.load(std::memory_order_relaxed);
    if (outstanding) write(latest);
    if (last) break;
    if (latest.number == done.load(std::memory_order_relaxed))
      wake.wait();
    else
      (void)wake.wait_for(kRetryPeriod);
  }
  ended.signal();
}

void MachineHoldWriter::Work::write(const State& state) {
  std::string why;
  try {
    const bool same = in_file && *in_file == state.machine;
    const auto written = same ? Result<void>{} : write_machine(file, state.machine);
    if (!written) why = written.error().text;
  } catch (const std::exception& error) {
    why = fmt::format("{}: internal error: {}", file.string(), error.what());
  }

  if (why.empty()) {
    in_file = state.machine;
    return done.store(state.number, std::memory_order_release);  // pairs with stored()
  }
  in_file.reset();
  fault.set({}, why);
  failed.store(state.number, std::memory_order_release);  // pairs with stored()
}

}  // namespace abbe::daemon
