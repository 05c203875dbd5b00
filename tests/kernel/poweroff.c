/* SPDX-License-Identifier: Apache-2.0 */
/* poweroff STATUS TTY…: the last program in the kernel for the tests. The terminals' output is
 * waited for, the kernel's process on the host ends with STATUS. */
#include <fcntl.h>
#include <stdio.h>
#include <sys/reboot.h>
#include <termios.h>
#include <unistd.h>

int main(int argc, char **argv)
{
    FILE *exitcode = fopen("/proc/exitcode", "w");

    if (argc < 2 || !exitcode || fputs(argv[1], exitcode) < 0 || fclose(exitcode) != 0) {
        perror("poweroff: /proc/exitcode");
        return 1; /* the end of process 1 is a panic: not a success */
    }
    for (int i = 2; i < argc; i++) {
        int tty = open(argv[i], O_WRONLY | O_NOCTTY);

        tcdrain(tty);
    }
    sync();
    reboot(RB_POWER_OFF);
    perror("poweroff");
    return 1;
}
