/* Two gyros at any rate, for bench/faults: bus_load BUS_A BUS_B PAIRS_PER_S SECONDS [OTHERS]
   Frames as in examples/twin.dbc. Intervals are random about their mean, so that nothing falls into step with a kernel's
   clock ticks. With OTHERS, pairs come evenly, and OTHERS frames of other identifiers follow each gyro's back to back, in
   one system call for each bus: under User Mode Linux, sending would otherwise take most of the machine. Prints the number
   of the gyros' frames, of all frames, and the lateness of the last one in seconds. */

#define _GNU_SOURCE
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { MOST = 64 };

static uint64_t state = 88172645463325252u;

static uint32_t dice(void) {
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return (uint32_t)(state >> 32);
}

static int open_bus(const char *name) {
  struct sockaddr_can address = {.can_family = AF_CAN};
  int fd = socket(PF_CAN, SOCK_RAW, CAN_RAW);
  address.can_ifindex = (int)if_nametoindex(name);
  setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0);
  if (fd < 0 || bind(fd, (struct sockaddr *)&address, sizeof address) != 0) {
    perror(name);
    exit(1);
  }
  return fd;
}

static void wait_until(int64_t ns) {
  struct timespec t = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {
  }
}

static void send_all(int fd, struct can_frame *frames, unsigned count) {
  struct iovec parts[MOST];
  struct mmsghdr messages[MOST] = {0};
  for (unsigned i = 0; i < count; ++i) {
    parts[i] = (struct iovec){&frames[i], sizeof frames[i]};
    messages[i].msg_hdr.msg_iov = &parts[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  for (unsigned sent = 0; sent < count;) {
    const int done = sendmmsg(fd, messages + sent, count - sent, 0);
    if (done > 0) sent += (unsigned)done;
    else usleep(100);
  }
}

static struct can_frame gyro_frame(int gyro, long number) {
  const int32_t raw = (gyro == 0 ? 33000 : -7400) + (int32_t)(dice() % 4096) - 2048;
  struct can_frame frame = {.can_id = gyro == 0 ? 0x101 : 0x102, .can_dlc = 8};
  for (int byte = 0; byte < 4; ++byte)
    frame.data[gyro == 0 ? byte : 3 - byte] = (uint8_t)((uint32_t)raw >> (8 * byte));
  frame.data[6] = (uint8_t)number;
  return frame;
}

static void send_frame(int fd, const struct can_frame *frame) {
  while (write(fd, frame, sizeof *frame) != sizeof *frame) usleep(100);
}

// Of the whole word, finite and in the range; anything else is wrong usage.
static double number(const char *word, double low, double high) {
  char *end = NULL;
  const double value = strtod(word, &end);
  if (end != word && *end == 0 && value >= low && value <= high) return value;
  fprintf(stderr, "%s: a number from %g to %g is needed\n", word, low, high);
  exit(2);
}

int main(int argc, char **argv) {
  if (argc < 5) return 2;
  const double rate = number(argv[3], 0.1, 1e6);
  const double seconds = number(argv[4], 0.0, 1e6);
  const int others = argc > 5 ? (int)number(argv[5], 0, MOST - 1) : 0;
  const int fds[2] = {open_bus(argv[1]), open_bus(argv[2])};
  const int64_t half = (int64_t)(0.5e9 / rate);
  const long pairs = (long)(rate * seconds);
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  int64_t due = (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
  for (long i = 0; i < pairs; ++i) {
    if (argc > 5) {
      due += 2 * half;
      wait_until(due);
    }
    for (int gyro = 0; gyro < 2; ++gyro) {
      struct can_frame frames[MOST] = {gyro_frame(gyro, i)};
      for (int other = 1; other <= others; ++other)
        frames[other] = (struct can_frame){.can_id = 0x300 + (uint32_t)other, .can_dlc = 8};
      if (argc == 5) {
        due += half / 2 + (int64_t)(dice() % (uint32_t)half);
        wait_until(due);
        send_frame(fds[gyro], &frames[0]);
      } else {
        send_all(fds[gyro], frames, 1 + (unsigned)others);
      }
    }
  }
  clock_gettime(CLOCK_MONOTONIC, &now);
  printf("%ld %ld %.3f\n", 2 * pairs, 2 * pairs * (1 + others),
         ((double)now.tv_sec * 1e9 + (double)now.tv_nsec - (double)due) * 1e-9);
  return 0;
}
